#include "libs/connecting/wide_guided.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

namespace mapmend {
namespace {

// Features of one frame by their place.
class Grid {
 public:
  Grid(const WideFeatures& features, const Pinhole& camera)
      : features_(features), columns_(camera.width / kCell + 1), rows_(camera.height / kCell + 1) {
    cells_.resize(static_cast<size_t>(columns_) * rows_);
    for (int i = 0; i < features.Size(); ++i) {
      const Eigen::Vector2f& p = features.keypoints[i].pixel;
      cells_[Cell(Column(p.x()), Row(p.y()))].push_back(i);
    }
  }
  template <typename Visit>
  void ForEach(const Eigen::Vector2d& center, double radius, Visit visit) const {
    for (int row = Row(center.y() - radius); row <= Row(center.y() + radius); ++row) {
      for (int column = Column(center.x() - radius); column <= Column(center.x() + radius); ++column) {
        for (const int i : cells_[Cell(column, row)]) {
          if ((features_.keypoints[i].pixel.cast<double>() - center).squaredNorm() <= radius * radius) visit(i);
        }
      }
    }
  }

 private:
  static constexpr int kCell = 32;
  int Column(double x) const { return std::clamp(static_cast<int>(x / kCell), 0, columns_ - 1); }
  int Row(double y) const { return std::clamp(static_cast<int>(y / kCell), 0, rows_ - 1); }
  size_t Cell(int column, int row) const { return static_cast<size_t>(row) * columns_ + column; }

  const WideFeatures& features_;
  int columns_, rows_;
  std::vector<std::vector<int>> cells_;
};

struct Prediction {
  Eigen::Vector2d pixel;
  double radius = 0;  // pixels
  double size = 0;    // of the patch, pixels
};

// Where a point of the source should be in a frame of the target; false if it is outside, too small or too vague.
bool Predict(const WideSide& source, const WideTrack& track, const WideSide& target, int frame,
             const Similarity3& target_from_source, double guided_radius, Prediction* out) {
  const Rigid3& cam = target.frames[frame].cam_from_submap;
  const Pinhole& camera = target.view.camera;
  const Eigen::Vector3d x = cam * (target_from_source * track.point);
  if (!(x.z() > 1e-9)) return false;
  out->pixel = camera.Project(x);
  if (out->pixel.x() < 0 || out->pixel.y() < 0 || out->pixel.x() >= camera.width || out->pixel.y() >= camera.height)
    return false;
  const double iz = 1 / x.z();
  Eigen::Matrix<double, 2, 3> J;
  J << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  J *= cam.rotation.toRotationMatrix() * target_from_source.scale * target_from_source.rotation.toRotationMatrix();
  const Eigen::Matrix2d S = J * track.covariance * J.transpose();
  out->radius = guided_radius + 2 * std::sqrt(std::max(0.0, S.trace()));
  constexpr double kLeastSize = 2.5, kWidest = 4;  // pixels; of the guided radius
  if (out->radius > kWidest * guided_radius) return false;
  const WideObservation& o = track.observations.back();
  const double depth = (source.frames[o.frame].cam_from_submap * track.point).z();
  out->size = source.Keypoint(o).SizePx() * target_from_source.scale * depth / source.view.camera.fx * camera.fx * iz;
  return depth > 0 && out->size >= kLeastSize;
}

struct Votes {
  std::map<std::pair<int, int>, WideTrackMatch> of_pair;  // (a's track, b's)
  int num_expected = 0, num_found = 0;
};

// The feature near the predicted place that looks most alike; -1 if none does.
int FindFeature(const WideSide& source, const WideTrack& track, const WideFeatures& features, const Grid& grid,
                const Prediction& predicted, const WideRegistrationOptions& options, int* squared_distance) {
  constexpr double kMaxSizeChange = 16;  // sixteenths of an octave
  const double size = WideKeypoint::kSizesPerOctave * std::log2(predicted.size);
  int first = std::numeric_limits<int>::max(), second = first, at = -1;
  grid.ForEach(predicted.pixel, predicted.radius, [&](int i) {
    if (std::abs(features.keypoints[i].size - size) > kMaxSizeChange) return;
    const int distance =
        std::min(WideSquaredDistance(source.Descriptor(track.observations.front()), features.descriptors[i]),
                 WideSquaredDistance(source.Descriptor(track.observations.back()), features.descriptors[i]));
    const bool is_same = at >= 0 && (features.keypoints[i].pixel - features.keypoints[at].pixel).squaredNorm() <
                                        options.matching.same_place * options.matching.same_place;
    if (distance < first) {
      if (!is_same) second = first;
      first = distance;
      at = i;
    } else if (!is_same) {
      second = std::min(second, distance);
    }
  });
  *squared_distance = first;
  const bool stands_out = first <= options.guided_ratio * options.guided_ratio * second;
  return at >= 0 && first <= options.guided_max_distance && stands_out ? at : -1;
}

void SearchOneWay(const WideSide& source, const WideSide& target, const Similarity3& target_from_source,
                  bool source_is_a, const WideRegistrationOptions& options, Votes* votes) {
  std::vector<Grid> grids;
  for (const WideFrame& f : target.frames) grids.emplace_back(*f.features, target.view.camera);
  for (int t = 0; t < static_cast<int>(source.tracks.size()); ++t) {
    const WideTrack& track = source.tracks[t];
    if (!track.has_point || track.observations.empty()) continue;
    bool expected = false, found = false;
    for (int f = 0; f < static_cast<int>(target.frames.size()); ++f) {
      Prediction predicted;
      if (!Predict(source, track, target, f, target_from_source, options.guided_radius, &predicted)) continue;
      expected = true;
      int distance = 0;
      const int i = FindFeature(source, track, *target.frames[f].features, grids[f], predicted, options, &distance);
      if (i < 0) continue;
      found = true;
      const int other = target.track_of[f][i];
      const std::pair<int, int> key = source_is_a ? std::pair(t, other) : std::pair(other, t);
      WideTrackMatch& match = votes->of_pair[key];
      std::tie(match.track_a, match.track_b) = key;
      if (match.num_votes++ == 0 || distance < match.squared_distance) match.squared_distance = distance;
    }
    votes->num_expected += expected;
    votes->num_found += found;
  }
}

}  // namespace

WideGuidedMatches SearchGuided(const WideSide& a, const WideSide& b, const Similarity3& b_from_a,
                               const WideRegistrationOptions& options) {
  Votes votes;
  SearchOneWay(a, b, b_from_a, true, options, &votes);
  SearchOneWay(b, a, b_from_a.Inverse(), false, options, &votes);
  WideGuidedMatches result;
  result.num_expected = votes.num_expected;
  result.num_found = votes.num_found;
  for (const auto& [key, match] : votes.of_pair) result.matches.push_back(match);
  std::stable_sort(result.matches.begin(), result.matches.end(), [](const WideTrackMatch& l, const WideTrackMatch& r) {
    return l.num_votes != r.num_votes ? l.num_votes > r.num_votes : l.squared_distance < r.squared_distance;
  });
  std::vector<char> used_a(a.tracks.size(), 0), used_b(b.tracks.size(), 0);
  std::erase_if(result.matches, [&](const WideTrackMatch& m) {
    if (used_a[m.track_a] || used_b[m.track_b]) return true;
    used_a[m.track_a] = used_b[m.track_b] = 1;
    return false;
  });
  return result;
}

}  // namespace mapmend

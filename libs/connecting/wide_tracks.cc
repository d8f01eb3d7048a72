#include "libs/connecting/wide_tracks.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>

#include "libs/base/options.h"
#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

struct FrameMatch {
  WideObservation a, b;
  int squared_distance = 0;
};

// Of each frame those at these distances behind it: near ones hold tracks together, far ones bring a wide angle.
constexpr int kSteps[] = {1, 2, 3, 5, 7};

// Pixels of b against pixels of a: u_b^T F u_a = 0.
Eigen::Matrix3d FundamentalMatrix(const Pinhole& camera, const Rigid3& b_from_a) {
  Eigen::Matrix3d inverse_k;
  inverse_k << 1 / camera.fx, 0, -camera.cx / camera.fx, 0, 1 / camera.fy, -camera.cy / camera.fy, 0, 0, 1;
  return inverse_k.transpose() * Skew(b_from_a.translation) * b_from_a.rotation.toRotationMatrix() * inverse_k;
}

// The nearest features of one frame to those of another, among those near their epipolar lines.
void MatchFrames(const WideSide& side, int a, int b, const WideTrackOptions& options, std::vector<FrameMatch>* out) {
  const WideFeatures &in_a = *side.frames[a].features, &in_b = *side.frames[b].features;
  const Eigen::Matrix3f F =
      FundamentalMatrix(side.view.camera, side.frames[b].cam_from_submap * side.frames[a].cam_from_submap.Inverse())
          .cast<float>();
  const int n = in_b.Size();
  std::vector<float> x(n), y(n), limit(n);
  std::vector<int> norm(n), nearest_of_b(n, -1), best_of_b(n, std::numeric_limits<int>::max());
  for (int j = 0; j < n; ++j) {
    x[j] = in_b.keypoints[j].pixel.x();
    y[j] = in_b.keypoints[j].pixel.y();
    const auto reach = static_cast<float>(options.max_distance * WideSigma(in_b.keypoints[j]));
    limit[j] = reach * reach;
    norm[j] = WideDot(in_b.descriptors[j], in_b.descriptors[j]);
  }
  const double max_ratio = options.ratio * options.ratio;
  std::vector<FrameMatch> found;
  std::vector<char> is_near(n);
  for (int i = 0; i < in_a.Size(); ++i) {
    const Eigen::Vector3f line = F * in_a.keypoints[i].pixel.homogeneous();
    const float scale = line.head<2>().squaredNorm();
    for (int j = 0; j < n; ++j) {
      const float d = line.x() * x[j] + line.y() * y[j] + line.z();
      is_near[j] = d * d <= limit[j] * scale;
    }
    const int norm_a = WideDot(in_a.descriptors[i], in_a.descriptors[i]);
    int first = std::numeric_limits<int>::max(), second = first, at = -1;
    for (int j = 0; j < n; ++j) {
      if (!is_near[j] || std::abs(in_a.keypoints[i].size - in_b.keypoints[j].size) > options.max_size_change) continue;
      const int distance = norm_a + norm[j] - 2 * WideDot(in_a.descriptors[i], in_b.descriptors[j]);
      if (distance < best_of_b[j]) {
        best_of_b[j] = distance;
        nearest_of_b[j] = i;
      }
      if (distance < first) {
        second = first;
        first = distance;
        at = j;
      } else {
        second = std::min(second, distance);
      }
    }
    // Half the distance of descriptors with nothing in common: with few rivals the ratio alone says little.
    constexpr int kMaxDistance = 45000;
    if (at >= 0 && first <= kMaxDistance && first <= max_ratio * second) found.push_back({{a, i}, {b, at}, first});
  }
  for (const FrameMatch& m : found) {
    if (nearest_of_b[m.b.feature] == m.a.feature) out->push_back(m);
  }
}

// Best matches first; two tracks that a frame sees both are not joined.
void JoinTracks(std::vector<FrameMatch> matches, WideSide* side) {
  std::stable_sort(matches.begin(), matches.end(),
                   [](const FrameMatch& l, const FrameMatch& r) { return l.squared_distance < r.squared_distance; });
  std::vector<WideTrack>& tracks = side->tracks;
  for (const FrameMatch& m : matches) {
    const int ta = side->track_of[m.a.frame][m.a.feature], tb = side->track_of[m.b.frame][m.b.feature];
    if (ta == tb) continue;
    const auto& in_b = tracks[tb].observations;
    const bool conflict =
        std::any_of(tracks[ta].observations.begin(), tracks[ta].observations.end(), [&](const auto& o) {
          return std::any_of(in_b.begin(), in_b.end(), [&](const auto& p) { return p.frame == o.frame; });
        });
    if (conflict) continue;
    const int into = std::min(ta, tb), from = std::max(ta, tb);
    for (const WideObservation& o : tracks[from].observations) {
      side->track_of[o.frame][o.feature] = into;
      tracks[into].observations.push_back(o);
    }
    tracks[from].observations.clear();
  }
}

struct Residual {
  Eigen::Vector2d error;  // sigma
  Eigen::Matrix<double, 2, 3> by_point;
};

std::optional<Residual> Project(const WideSide& side, const WideObservation& o, const Eigen::Vector3d& point) {
  const Rigid3& cam = side.frames[o.frame].cam_from_submap;
  const Pinhole& camera = side.view.camera;
  const Eigen::Vector3d x = cam * point;
  if (!(x.z() > 1e-9)) return std::nullopt;
  const WideKeypoint& keypoint = side.Keypoint(o);
  const double iz = 1 / x.z(), is = 1 / WideSigma(keypoint);
  Residual r;
  r.error = is * (camera.Project(x) - keypoint.pixel.cast<double>());
  Eigen::Matrix<double, 2, 3> projection;
  projection << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  r.by_point = is * projection * cam.rotation.toRotationMatrix();
  return r;
}

// The point nearest to all rays, in the linear sense.
std::optional<Eigen::Vector3d> NearestToRays(const WideSide& side, const std::vector<WideObservation>& observations) {
  Eigen::Matrix3d N = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (const WideObservation& o : observations) {
    const Rigid3& cam = side.frames[o.frame].cam_from_submap;
    const Eigen::Vector3d ray =
        (cam.rotation.conjugate() * side.view.camera.Unproject(side.Keypoint(o).pixel.cast<double>())).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    N += across;
    g += across * cam.Center();
  }
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(N);
  if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 1e-10)) return std::nullopt;
  return ldlt.solve(g);
}

// Gauss-Newton on the reprojections; the normal matrix at the end.
std::optional<Eigen::Matrix3d> RefinePoint(const WideSide& side, const std::vector<WideObservation>& observations,
                                           Eigen::Vector3d* point) {
  Eigen::Matrix3d N;
  constexpr int kIterations = 5;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    N.setZero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const WideObservation& o : observations) {
      const auto r = Project(side, o, *point);
      if (!r) return std::nullopt;
      N += r->by_point.transpose() * r->by_point;
      g += r->by_point.transpose() * r->error;
    }
    const Eigen::Vector3d step = N.ldlt().solve(-g);
    if (!step.allFinite()) return std::nullopt;
    *point += step;
  }
  return N;
}

// Drops the worst observation until the others agree, while there are three of them; of two that disagree nothing
// remains. Dropped ones become tracks of their own.
void Triangulate(const WideTrackOptions& options, int index, WideSide* side) {
  WideTrack& track = side->tracks[index];
  std::vector<WideObservation> dropped;
  while (track.observations.size() >= 2) {
    std::optional<Eigen::Vector3d> point = NearestToRays(*side, track.observations);
    std::optional<Eigen::Matrix3d> information;
    if (point) information = RefinePoint(*side, track.observations, &*point);
    double worst = information ? 0 : std::numeric_limits<double>::infinity();
    size_t worst_at = track.observations.size() - 1;
    for (size_t i = 0; information && i < track.observations.size(); ++i) {
      const auto r = Project(*side, track.observations[i], *point);
      const double squared = r ? r->error.squaredNorm() : std::numeric_limits<double>::infinity();
      if (squared <= worst) continue;
      worst = squared;
      worst_at = i;
    }
    // Parallel rays have no point, but agree.
    if (!information && track.observations.size() == 2) break;
    if (worst <= options.max_squared_error) {
      const Eigen::Matrix3d covariance = information->inverse();
      const Rigid3& cam = side->frames[track.observations.front().frame].cam_from_submap;
      const Eigen::Vector3d axis = cam.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      const double depth = (cam * *point).z(), variance = axis.dot(covariance * axis);
      track.has_point = variance > 0 && variance < std::pow(options.max_depth_sigma * depth, 2);
      track.point = *point;
      track.covariance = covariance;
      break;
    }
    dropped.push_back(track.observations[worst_at]);
    track.observations.erase(track.observations.begin() + static_cast<long>(worst_at));
  }
  for (const WideObservation& o : dropped) {
    side->track_of[o.frame][o.feature] = static_cast<int>(side->tracks.size());
    side->tracks.emplace_back().observations = {o};  // `track` is no longer valid
  }
}

}  // namespace

std::string WideTrackOptions::Check() const { return CheckOptions(*this); }

double WideSigma(const WideKeypoint& keypoint) {
  constexpr double kLeast = 0.8, kOfSize = 0.12;
  return std::hypot(kLeast, kOfSize * keypoint.SizePx());
}

namespace {

// Every feature of a new frame becomes a track.
void BeginTracks(WideFrame frame, WideSide* side) {
  const int f = static_cast<int>(side->frames.size());
  std::vector<int>& tracks = side->track_of.emplace_back();
  for (int i = 0; i < frame.features->Size(); ++i) {
    tracks.push_back(static_cast<int>(side->tracks.size()));
    side->tracks.emplace_back().observations = {{f, i}};
  }
  side->frames.push_back(std::move(frame));
}

// Tracks that have grown since they were triangulated.
void TriangulateGrown(const WideTrackOptions& options, const std::vector<size_t>& sizes, WideSide* side) {
  const int num_tracks = static_cast<int>(side->tracks.size());
  for (int t = 0; t < num_tracks; ++t) {
    std::vector<WideObservation>& observations = side->tracks[t].observations;
    if (observations.size() < 2 || (t < static_cast<int>(sizes.size()) && observations.size() <= sizes[t])) continue;
    std::sort(observations.begin(), observations.end(),
              [](const WideObservation& l, const WideObservation& r) { return l.frame < r.frame; });
    Triangulate(options, t, side);
  }
}

}  // namespace

WideSide MakeWideSide(const SubmapView& view, std::vector<WideFrame> frames, const WideTrackOptions& options) {
  WideSide side;
  side.view = view;
  for (WideFrame& frame : frames) BeginTracks(std::move(frame), &side);
  std::vector<FrameMatch> matches;
  for (int a = 0; a < static_cast<int>(side.frames.size()); ++a) {
    for (const int step : kSteps) {
      if (a + step < static_cast<int>(side.frames.size())) MatchFrames(side, a, a + step, options, &matches);
    }
  }
  JoinTracks(std::move(matches), &side);
  TriangulateGrown(options, {}, &side);
  return side;
}

void AddWideFrame(WideFrame frame, const WideTrackOptions& options, WideSide* side) {
  std::vector<size_t> sizes;
  for (const WideTrack& t : side->tracks) sizes.push_back(t.observations.size());
  BeginTracks(std::move(frame), side);
  const int b = static_cast<int>(side->frames.size()) - 1;
  WideTrackOptions wider = options;
  wider.max_size_change = options.max_size_change_between;
  std::vector<FrameMatch> matches;
  for (int a = std::max(0, b - options.num_before); a < b; ++a) MatchFrames(*side, a, b, wider, &matches);
  JoinTracks(std::move(matches), side);
  TriangulateGrown(options, sizes, side);
}

}  // namespace mapmend

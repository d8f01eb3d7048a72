#include "libs/connecting/guided_projection.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapmend {
// Exact about the optical axis, and the closest such rotation otherwise.
double InPlaneTurn(const Eigen::Matrix3d& r) { return std::atan2(r(1, 0) - r(0, 1), r(0, 0) + r(1, 1)); }

double WrapAngle(double angle) { return angle - 2 * M_PI * std::floor((angle + M_PI) / (2 * M_PI)); }

namespace {

// Octaves at which points are predicted, by part of the image.
class PredictedOctaves {
 public:
  PredictedOctaves(const Pinhole& camera, int tolerance) : camera_(camera), tolerance_(tolerance) {}

  void Add(const Eigen::Vector2d& pixel, int octave) {
    auto& [low, high] = ranges_[Cell(pixel)];
    low = std::min(low, octave - tolerance_);
    high = std::max(high, octave + tolerance_);
  }
  bool Reach(const Keypoint& keypoint) const {
    const auto& [low, high] = ranges_[Cell(keypoint.pixel.cast<double>())];
    return keypoint.octave >= low && keypoint.octave <= high;
  }

 private:
  static constexpr int kColumns = 8, kRows = 6;
  size_t Cell(const Eigen::Vector2d& pixel) const {
    const int column = std::clamp(static_cast<int>(kColumns * pixel.x() / camera_.width), 0, kColumns - 1);
    const int row = std::clamp(static_cast<int>(kRows * pixel.y() / camera_.height), 0, kRows - 1);
    return static_cast<size_t>(kColumns * row + column);
  }

  const Pinhole& camera_;
  const int tolerance_;
  std::vector<std::pair<int, int>> ranges_ = std::vector<std::pair<int, int>>(kColumns * kRows, {1000, -1000});
};

}  // namespace

void AppendAppearances(const SubmapView& view, const SubmapKeyframe& keyframe, int source,
                       std::vector<PointAppearance>* appearances) {
  for (int i = 0; i < keyframe.features.Size(); ++i) {
    const MapPointId id = keyframe.map_points[i];
    const auto point = id.IsValid() ? view.submap->points.find(id) : view.submap->points.end();
    if (point == view.submap->points.end()) continue;
    const Eigen::Vector3d position = point->second.position.cast<double>();
    const double depth = (keyframe.cam_from_submap * position).z();
    if (!(depth > 0)) continue;
    const Keypoint& keypoint = keyframe.features.keypoints[i];
    appearances->push_back({id, position, keyframe.features.descriptors[i], keypoint.octave, keypoint.angle,
                            view.pyramid.Scale(keypoint.octave) * depth / view.camera.fx, source});
  }
}

ProjectionMatches FindByProjection(const std::vector<PointAppearance>& appearances,
                                   const std::vector<Eigen::Quaterniond>& source_rotations,
                                   const Similarity3& cam_from_owner, const Pinhole& camera, const Pyramid& pyramid,
                                   const std::vector<Keypoint>& keypoints, const std::vector<Descriptor>& descriptors,
                                   const FeatureGrid& grid, const ProjectionSearchOptions& options) {
  ProjectionMatches result;
  std::vector<double> turns;
  for (const Eigen::Quaterniond& rotation : source_rotations) {
    turns.push_back(InPlaneTurn((cam_from_owner.rotation * rotation.conjugate()).toRotationMatrix()));
  }
  std::vector<double> scales;
  for (int o = 0; o < pyramid.num_levels; ++o) scales.push_back(pyramid.Scale(o));
  const double log_factor = std::log(pyramid.scale_factor);
  std::vector<ProjectionMatch> best_of_feature(keypoints.size());
  PredictedOctaves octaves(camera, options.octave_tolerance);

  for (size_t k = 0; k < appearances.size(); ++k) {
    const PointAppearance& appearance = appearances[k];
    const Eigen::Vector3d x = cam_from_owner * appearance.position;
    if (!(x.z() > 0)) continue;
    const Eigen::Vector2d predicted = camera.Project(x);
    if (predicted.x() < -options.border || predicted.y() < -options.border ||
        predicted.x() >= camera.width + options.border || predicted.y() >= camera.height + options.border) {
      continue;
    }
    const double size_px = appearance.size * cam_from_owner.scale * camera.fx / x.z();
    const int octave = static_cast<int>(std::lround(std::log(size_px) / log_factor));
    if (octave < -options.octave_tolerance || octave >= pyramid.num_levels + options.octave_tolerance) continue;
    result.num_visible += octave >= -1 && octave <= pyramid.num_levels;
    octaves.Add(predicted, octave);
    const int clamped = std::clamp(octave, 0, pyramid.num_levels - 1);
    const double radius = options.radius * scales[clamped];
    const double turn = turns[appearance.source];

    ProjectionMatch best{static_cast<int>(k), -1, 256};
    int second = 256;
    grid.VisitNear(predicted.cast<float>(), static_cast<float>(radius), [&](int i) {
      const Keypoint& keypoint = keypoints[i];
      if (std::abs(keypoint.octave - octave) > options.octave_tolerance) return;
      if ((keypoint.pixel.cast<double>() - predicted).squaredNorm() > radius * radius) return;
      if (std::abs(WrapAngle(keypoint.angle - appearance.angle - turn)) > options.max_turn) return;
      const int distance = HammingDistance(descriptors[i], appearance.descriptor);
      if (distance < best.distance) {
        // The same corner is often found on neighbouring octaves: that is no rival.
        const bool same_corner =
            best.feature >= 0 && (keypoints[best.feature].pixel - keypoint.pixel).squaredNorm() < 2.0 * scales[clamped];
        if (!same_corner) second = best.distance;
        best.feature = i;
        best.distance = distance;
      } else if (distance < second &&
                 (keypoints[best.feature].pixel - keypoint.pixel).squaredNorm() >= 2.0 * scales[clamped]) {
        second = distance;
      }
    });
    if (best.feature < 0 || best.distance > options.max_distance || best.distance > options.ratio * second) continue;
    ProjectionMatch& holder = best_of_feature[best.feature];
    if (best.distance < holder.distance) holder = best;
  }
  for (const Keypoint& keypoint : keypoints) result.num_reachable += octaves.Reach(keypoint);
  for (const ProjectionMatch& match : best_of_feature) {
    if (match.feature >= 0) result.matches.push_back(match);
  }
  return result;
}

}  // namespace mapmend

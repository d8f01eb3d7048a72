#pragma once

#include <optional>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "procs/frontend/local_mapper_options.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct DepthRange {
  double near = 0, far = 0;  // before the camera, in units of the submap
};

// A place that two keyframes see and the map does not know yet.
struct NewPoint {
  FeatureIndex feature_a, feature_b;
  Eigen::Vector3d position;  // submap frame
};

// Finds new points of two keyframes: each feature of a that has no point is searched along the segment of its epipolar
// line in b that the depths allow, triangulated, and kept if both images, the angle of the rays and the sizes of the
// patches agree.
class EpipolarTriangulation {
 public:
  EpipolarTriangulation(const LocalMapperOptions& options, const Pinhole& camera, const Pyramid& pyramid);

  // depths: of points before a. By feature_b, ascending; if several features of a claim one of b, the one with the
  // nearest descriptor has it.
  std::vector<NewPoint> FindPoints(const WorkingKeyframe& a, const WorkingKeyframe& b, const DepthRange& depths) const;

 private:
  // Both keyframes and what follows of their poses.
  struct View {
    const WorkingKeyframe &a, &b;
    DepthRange depths;
    Rigid3 b_from_a;
    Eigen::Matrix3d rotation;  // of b_from_a
  };
  struct Found {
    FeatureIndex feature;  // of b; none: none is clearly best
    int distance = 0;      // bits
  };
  // Of photos, whose thousands of features are so dense that many lie along any line: whatever is most alike in the
  // whole image, for each feature of a.
  static std::vector<Found> FindAlike(const View& view);
  Found SearchAlongLine(const View& view, FeatureIndex feature, const Eigen::Vector3d& ray) const;
  // In a's frame. None if it does not fit.
  std::optional<Eigen::Vector3d> PointOf(const View& view, FeatureIndex feature_a, const Eigen::Vector3d& ray,
                                         FeatureIndex feature_b) const;

  LocalMapperOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  double max_cosine_;           // between the rays of a point
  std::vector<double> limits_;  // from the epipolar line, pixels, by octave
};

}  // namespace mapmend

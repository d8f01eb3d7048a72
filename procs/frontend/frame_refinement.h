#pragma once

#include <optional>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/pnp.h"
#include "libs/optim/pose_optimization.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct FrameRefinementOptions {
  bool use = true;
  int min_points = 25;          // that are still in the map
  double min_kept_share = 0.7;  // of them, that must still fit
  PoseOptimizationOptions pose;
  PnpOptions pnp;  // where nothing is known of the pose

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("use", use);
    v("min_points", min_points, Range(6, 100000), "points");
    v("min_kept_share", min_kept_share, Range(0, 1), "of the points");
    v("pose", pose);
    v("pnp", pnp);
  }
};

// A point that a frame has seen, and where.
struct Sighting {
  PointIndex point;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  float sigma = 1;  // pixels
};

// What a frame has seen. points: one for each of its features, none where it shows no known point.
std::vector<Sighting> SightingsOf(const Frame& frame, const std::vector<PointIndex>& points, const Pyramid& pyramid);

// A frame between two keyframes was tracked in the map as it was before the second of them joined it. Its pose is found
// again from the points that it saw, where these are now.
class FrameRefinement {
 public:
  FrameRefinement(const FrameRefinementOptions& options, const Pinhole& camera) : options_(options), camera_(camera) {}

  // Nothing if too few points are left, or too few of them fit.
  //   cam_from_submap  by the reference keyframe, as this has moved
  std::optional<Rigid3> Refine(const Rigid3& cam_from_submap, const std::vector<Sighting>& sightings,
                               const WorkingMap& map) const;
  // The same where nothing is known of the pose.
  std::optional<Rigid3> FindAnew(const std::vector<Sighting>& sightings, const WorkingMap& map) const;

 private:
  std::optional<Rigid3> Optimize(const Rigid3& cam_from_submap, const std::vector<PoseObservation>& observations) const;

  FrameRefinementOptions options_;
  Pinhole camera_;
};

}  // namespace mapmend

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/optim/pose_optimization.h"
#include "procs/frontend/loss_reason.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct TrackerOptions {
  int min_inliers = 25;           // fewer: the frame is not tracked
  double min_spread = 0.08;       // share of the 8 x 6 cells of the image that hold an inlier
  double min_found_share = 0.06;  // inliers, of the points of the local map that should be in view
  double max_position_sigma =
      0.0125;  // of the median depth: four times that is a wrong pose. Twice as much with a prediction.
  double motion_radius = 0.025;  // search radius around the motion model's prediction, of the image width
  int min_motion_matches = 20;   // fewer: wider search, then descriptor matching
  double local_radius_px = 4;    // search radius in the local map, at octave 0
  int max_local_keyframes = 30;
  // For a frame that is tracked afterwards: share of the image's cells that must hold an inlier, and the largest
  // standard deviation of its position, of the median depth.
  double min_spread_afterwards = 0.2;
  double max_position_sigma_afterwards = 0.008;
  uint64_t seed = 1;
};

struct TrackResult {
  bool success = false;
  LossReason reason = LossReason::kNone;    // if not: too_few_matches, too_few_inliers, unsupported_pose
  TrackMethod method = TrackMethod::kNone;  // motion, wide, descriptors
  int num_inliers = 0;
  int num_visible = 0;  // points of the local map that should be in view
  double spread = 0;
  double position_sigma = 0;    // of the median depth; known if the inliers are enough
  int reference_keyframe = -1;  // that shares most points
};

// Finds the pose of a frame in the working map. Three ways, cheapest first: around the motion model's prediction; the
// same with a wide window; descriptor matching to keyframes with PnP RANSAC (needs no prediction: survey photos move by
// a tenth of the image and turn at the end of each strip). Then the local map is projected and all matches are
// optimised together.
class Tracker {
 public:
  Tracker(const TrackerOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // prediction: cam_from_submap by the motion model, if there is one. hints: keyframes to match with, best first. On
  // success frame->points and cam_from_submap are set; on failure frame->points is all -1.
  TrackResult Track(const std::optional<Rigid3>& prediction, const std::vector<int>& hints, WorkingMap* map,
                    Frame* frame) const;
  // A frame of the past, for which nothing that follows will tell whether its pose was right: its points must be spread
  // wider and fix it better.
  TrackResult TrackAfterwards(const std::vector<int>& hints, WorkingMap* map, Frame* frame) const;

 private:
  // Keyframes whose points are searched: those that share points with the frame, then those they share points with.
  std::vector<int> LocalKeyframes(const WorkingMap& map, const std::vector<int>& seeds, const Frame& frame) const;
  std::vector<int> VisiblePoints(const WorkingMap& map, const std::vector<int>& points, const Rigid3& pose) const;
  int SearchPoints(const WorkingMap& map, const std::vector<int>& points, const Rigid3& pose, double radius_px,
                   bool scale_radius, int max_distance, Frame* frame) const;
  std::vector<PoseObservation> Observations(const WorkingMap& map, const Frame& frame) const;
  bool Optimize(const WorkingMap& map, const Rigid3& initial, Frame* frame, int* num_inliers) const;
  bool MatchKeyframe(const WorkingMap& map, int keyframe, Frame* frame) const;

  TrackerOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
};

}  // namespace mapmend

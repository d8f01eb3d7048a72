#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/matching.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/pnp.h"
#include "libs/geometry/rigid3.h"
#include "libs/optim/pose_optimization.h"
#include "procs/frontend/initializer.h"
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
  double min_view_cos = 0.5;  // a point seen from more than 60 degrees off its usual direction looks different
  // Octaves about the one that the distance predicts.
  int octaves_below = 2, octaves_above = 1;
  // The search around the prediction. Its window is wide and holds many features: only clear matches count.
  double wide_factor = 3;        // of motion_radius, for a second search if too few were found in the first
  int motion_max_distance = 64;  // bits
  double motion_ratio = 0.9;
  double min_motion_share = 0.25;  // of the matches, that must be inliers: less are found by chance
  // The search in the local map. Its window is small: descriptors that have changed may match.
  int local_max_distance = 80;  // bits
  double local_ratio = 0.85;
  // Without prediction, or where that failed: descriptors of a keyframe against those of the frame, whatever lies
  // where.
  MatchOptions matching = {.ratio = 0.85};
  PnpOptions pnp;
  double min_descriptor_share = 0.75;  // inliers, of min_motion_matches: PnP has left out the wrong ones
  // Of the local map: neighbours of the keyframes that share most points with the frame.
  int num_expanded = 3;               // of those keyframes
  int max_neighbours = 8;             // of each of them
  int min_shared_points = 15;         // with it
  double predicted_sigma_factor = 2;  // of max_position_sigma, where the motion model has predicted the pose
  PoseOptimizationOptions pose;
  uint64_t seed = 1;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_inliers", min_inliers, Range(3, 100000), "points");
    v("min_spread", min_spread, Range(0, 1), "of the image's cells");
    v("min_found_share", min_found_share, Range(0, 1), "of the points in view");
    v("max_position_sigma", max_position_sigma, MoreThan(0), "of the median depth");
    v("motion_radius", motion_radius, Range(0, 1), "of the image width");
    v("min_motion_matches", min_motion_matches, Range(4, 100000));
    v("local_radius_px", local_radius_px, MoreThan(0), "pixels at octave 0");
    v("max_local_keyframes", max_local_keyframes, Range(1, 10000), "keyframes");
    v("min_view_cos", min_view_cos, Range(-1, 1), "cosine");
    v("octaves_below", octaves_below, Range(0, 31), "octaves");
    v("octaves_above", octaves_above, Range(0, 31), "octaves");
    v("wide_factor", wide_factor, AtLeast(1));
    v("motion_max_distance", motion_max_distance, Range(0, 256), "bits");
    v("motion_ratio", motion_ratio, Range(0, 1));
    v("min_motion_share", min_motion_share, Range(0, 1), "of the matches");
    v("local_max_distance", local_max_distance, Range(0, 256), "bits");
    v("local_ratio", local_ratio, Range(0, 1));
    v("matching", matching);
    v("pnp", pnp);
    v("min_descriptor_share", min_descriptor_share, Range(0, 1));
    v("num_expanded", num_expanded, Range(0, 10000), "keyframes");
    v("max_neighbours", max_neighbours, Range(0, 10000), "keyframes");
    v("min_shared_points", min_shared_points, Range(1, 100000), "points");
    v("predicted_sigma_factor", predicted_sigma_factor, MoreThan(0));
    v("pose", pose);
    v("min_spread_afterwards", min_spread_afterwards, Range(0, 2), "of the image's cells");
    v("max_position_sigma_afterwards", max_position_sigma_afterwards, AtLeast(0), "of the median depth");
  }
};

struct TrackResult {
  bool success = false;
  LossReason reason = LossReason::kNone;    // if not: too_few_matches, too_few_inliers, unsupported_pose
  TrackMethod method = TrackMethod::kNone;  // motion, wide, descriptors
  int num_inliers = 0;
  int num_visible = 0;  // points of the local map that should be in view
  double spread = 0;
  double position_sigma = 0;         // of the median depth; known if the inliers are enough
  KeyframeIndex reference_keyframe;  // that shares most points
  // With success:
  Rigid3 cam_from_submap;
  std::vector<PointIndex> points;  // that the frame observes, one for each feature; none without
  // That are not in the map yet: seen by the reference keyframe and this frame; submap frame.
  std::vector<InitialPoint> new_points;
};

// Finds the pose of a frame in the working map. Three ways, cheapest first: around the motion model's prediction; the
// same with a wide window; descriptor matching to keyframes with PnP RANSAC (needs no prediction: survey photos move by
// a tenth of the image and turn at the end of each strip). Then the local map is projected and all matches are
// optimised together.
class Tracker {
 public:
  Tracker(const TrackerOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // prediction: cam_from_submap by the motion model, if there is one. hints: keyframes to match with, best first. With
  // success the map's counters of what was visible and found go up.
  TrackResult Track(const std::optional<Rigid3>& prediction, const std::vector<KeyframeIndex>& hints,
                    const Frame& frame, WorkingMap* map) const;
  // A frame of the past, for which nothing that follows will tell whether its pose was right: its points must be spread
  // wider and fix it better.
  TrackResult TrackAfterwards(const std::vector<KeyframeIndex>& hints, const Frame& frame, WorkingMap* map) const;

 private:
  // How points are searched around the pixels where they should be.
  struct Window {
    double radius_px = 0;
    bool grows_with_octave = false;  // radius_px is that of octave 0
    int max_distance = 0;            // bits
    double ratio = 1;
  };
  // In each of these, pose and points of the result are what is known of the frame so far.
  bool FindAroundPrediction(const Rigid3& prediction, const std::vector<KeyframeIndex>& hints, const Frame& frame,
                            const WorkingMap& map, TrackResult* result) const;
  bool FindByDescriptors(const std::vector<KeyframeIndex>& hints, const Frame& frame, const WorkingMap& map,
                         TrackResult* result) const;
  bool MatchKeyframe(const WorkingKeyframe& reference, const Frame& frame, const WorkingMap& map,
                     TrackResult* result) const;
  // Returns the points of the local map that should be in view.
  std::vector<PointIndex> SearchLocalMap(const std::vector<KeyframeIndex>& hints, const Frame& frame,
                                         const WorkingMap& map, TrackResult* result) const;
  // kNone: it is.
  LossReason WhyNotBelieved(const Frame& frame, const WorkingMap& map, TrackResult* result) const;

  // Keyframes whose points are searched: those that share points with the frame, then those they share points with.
  // seeds: instead of the former, if the frame has no points yet.
  std::vector<KeyframeIndex> LocalKeyframes(const WorkingMap& map, const std::vector<KeyframeIndex>& seeds,
                                            const std::vector<PointIndex>& points) const;
  std::vector<PointIndex> VisiblePoints(const WorkingMap& map, const std::vector<PointIndex>& points,
                                        const Rigid3& cam_from_submap) const;
  // Adds to what the frame observes those of the candidates that it shows as well. Returns how many.
  int SearchPoints(const WorkingMap& map, const std::vector<PointIndex>& candidates, const Rigid3& cam_from_submap,
                   const Window& window, const Frame& frame, std::vector<PointIndex>* points) const;
  std::vector<PoseObservation> Observations(const WorkingMap& map, const Frame& frame,
                                            const std::vector<PointIndex>& points) const;
  // From the result's points, which lose the outliers, and its pose.
  bool Optimize(const WorkingMap& map, const Frame& frame, TrackResult* result) const;

  TrackerOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
};

}  // namespace mapmend

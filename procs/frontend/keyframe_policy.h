#pragma once

#include "libs/base/range.h"
#include "procs/frontend/tracker.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct KeyframePolicyOptions {
  double min_shared = 0.7;        // inliers, of the solid points of the reference keyframe: fewer call for a keyframe
  int comfortable_inliers = 100;  // or fewer than this
  double max_angle_deg = 3;       // or points seen under an angle that differs by this much (median)
  // Or a view that has turned by so much, though nothing is to be triangulated: at a corner the scale passes from the
  // points before it to those behind it by what neighbouring keyframes share.
  double max_turn_deg = 14;
  // While a submap has at most so many keyframes, a frame becomes one as well if its points' parallax has grown by this
  // factor (median): depths become so much more certain.
  int young_keyframes = 8;
  double parallax_growth = 1.5;
  int urgent_inliers = 50;     // fewer: the submap might be lost without a keyframe
  int solid_observations = 3;  // keyframes that must see a point for it to count as solid ...
  int solid_early = 2;         // ... as long as the submap has no more keyframes than this

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_shared", min_shared, Range(0, 1));
    v("comfortable_inliers", comfortable_inliers, Range(0, 100000));
    v("max_angle_deg", max_angle_deg, Range(0.1, 45), "degrees");
    v("max_turn_deg", max_turn_deg, Range(1, 180), "degrees");
    v("young_keyframes", young_keyframes, Range(0, 100000), "keyframes");
    v("parallax_growth", parallax_growth, AtLeast(1));
    v("urgent_inliers", urgent_inliers, Range(0, 100000));
    v("solid_observations", solid_observations, Range(1, 100));
    v("solid_early", solid_early, Range(1, 100));
  }
};

// What is known of a frame that was tracked, beside the keyframe that shares most points with it.
struct KeyframeEvidence {
  int num_inliers = 0;
  int solid_points = 0;  // of the reference keyframe
  // Cosine of the median angle between the rays of frame and keyframe to the points. Parallax, not motion of the image:
  // a turn on the spot gives nothing to triangulate.
  double cos_angle = 1;
  double parallax_growth = 0;  // as ParallaxGrowth, of a frame in a young submap; else 0
  double turn_deg = 0;         // between the optical axes of frame and keyframe
};

// By what factor a frame would widen the angle under which its points are seen: the median, over its points, of the
// largest angle between its ray and those of the point's keyframes, over the angle between the rays of the point's
// first and last keyframe. 0 without points.
double ParallaxGrowth(const WorkingMap& map, const TrackResult& tracked);

// Whether a frame becomes a keyframe.
class KeyframePolicy {
 public:
  explicit KeyframePolicy(const KeyframePolicyOptions& options) : options_(options) {}

  // tracked: with success, in the map.
  KeyframeEvidence Measure(const WorkingMap& map, const TrackResult& tracked) const;
  bool NeedsKeyframe(const KeyframeEvidence& evidence) const;
  // A keyframe that is not in the map yet may bring the points that are lacking: only an urgent one joins it.
  bool IsUrgent(int num_inliers) const { return num_inliers < options_.urgent_inliers; }

 private:
  KeyframePolicyOptions options_;
};

}  // namespace mapmend

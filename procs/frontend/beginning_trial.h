#pragma once

#include <vector>

#include "libs/base/range.h"
#include "procs/frontend/initializer.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct BeginningTrialOptions {
  int patience = 90;  // frames since the beginning; then it stands, proved or not. 0: at once
  double max_step =
      0.04;  // shift of the image from frame to frame, of its width: faster, and there is no time for a trial
  int min_in_sight = 30;  // points of the first keyframe that are still tracked: fewer, and nothing can be asked of it
  double growth = 2;      // of the parallax, after which the beginning is asked
  double postponement = 1.2;  // further growth, after which it is asked again if there was no answer
  // What contradicts a beginning: where the camera is now differs by this much of the way that it has come, or depths
  // by this much of themselves (median).
  double max_place_error = 0.3;
  double max_depth_error = 0.15;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("patience", patience, Range(0, 100000), "frames");
    v("max_step", max_step, Range(0, 1), "of the image width");
    v("min_in_sight", min_in_sight, Range(0, 100000), "points");
    v("growth", growth, MoreThan(1));
    v("postponement", postponement, MoreThan(1));
    v("max_place_error", max_place_error, MoreThan(0), "of the way");
    v("max_depth_error", max_depth_error, MoreThan(0), "of the depth");
  }
};

// Two views under a small angle may be explained by a wrong motion better than by the true one: a rolling shutter and
// noise move points as far as the parallax does. What a wrong motion does not do is to foretell what two views show
// that have twice the parallax. So in a slow video a submap is tracked for a while before it is believed; when its
// parallax has doubled, the first view and the newest are taken as a beginning of their own. If both tell the same of
// camera and depths, the submap stands; if not, it is begun anew with the wider pair, which is asked in its turn. In
// photos with large steps the first view is soon out of sight, and its parallax large: they stand at once.
class BeginningTrial {
 public:
  enum class Verdict { kStands, kUndecided, kAsk };

  BeginningTrial(const BeginningTrialOptions& options, const Pinhole& camera) : options_(options), camera_(camera) {}

  // A submap has begun: its first two frames, and what came of them.
  void Begin(const Initialization& initialization, const WorkingMap& map);
  // After a frame that was tracked in the map, which saw these points. kAsk: the beginning is to be compared with that
  // of its first frame and this one.
  Verdict Next(const Rigid3& cam_from_submap, const std::vector<PointIndex>& points, const WorkingMap& map);
  // Whether a beginning with the same first frame contradicts the map, in which its second frame was tracked.
  bool Contradicts(const Initialization& wider, const Rigid3& cam_from_submap, const WorkingMap& map) const;
  // There is no such beginning yet.
  void Postpone() { ask_at_rad_ *= options_.postponement; }
  // The submap has gone, or is believed.
  void Clear() { num_frames_ = 0; }

 private:
  BeginningTrialOptions options_;
  Pinhole camera_;
  bool is_open_ = false;
  int num_frames_ = 0;  // since the first of several beginnings
  double ask_at_rad_ = 0;
};

}  // namespace mapmend

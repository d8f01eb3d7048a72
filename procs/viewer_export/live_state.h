#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "libs/bus/health.h"
#include "libs/map_view/map_model.h"
#include "libs/stream/stream_messages.h"
#include "procs/viewer_export/live_feed.h"

namespace mapmend {

// What the live page shows beside the map: where the camera is and how the processes are.
class LiveInputs {
 public:
  void OnFramePose(const FramePose& pose) { pose_ = pose; }
  void OnHealth(const Health& health);
  // Nothing could be heard for so long: nobody's silence counts.
  void WasDeaf(std::chrono::steady_clock::duration time);

  struct Heard {
    Health health;
    std::chrono::steady_clock::time_point arrival;
  };

  // Before any was received, one with an empty state.
  const FramePose& Pose() const { return pose_; }
  // By the name of the process; of several frontends, by the session as well.
  const std::map<std::string, Heard>& HealthOf() const { return health_; }

 private:
  FramePose pose_;
  std::map<std::string, Heard> health_;
};

// How the run stands that the page shows.
struct LiveRun {
  std::string folder;        // of results, absolute; empty: none
  bool is_stored = false;    // a finished map is shown, nothing is being made
  bool can_decide = false;   // connections can be switched off and on, with the token
  bool exported = false;     // the exports of this very map have been written
  bool has_stopped = false;  // the viewer is about to end
};

// The values of the feed that can be told without working out the whole map (docs/live_page.md). Equal ones cost
// nothing on the way.

// run, pose, process/NAME.
void PublishState(const MapModel& model, const LiveInputs& inputs, const LiveRun& run, LiveFeed* feed);

// session/N, submap/KEY, edge/KEY|KEY.
//   decisions  of people, on connections
void PublishParts(const MapModel& model, const std::vector<EdgeDecision>& decisions, LiveFeed* feed);

}  // namespace mapmend

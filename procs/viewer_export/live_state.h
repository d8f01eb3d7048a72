#pragma once

#include <chrono>
#include <map>
#include <string>

#include "libs/bus/health.h"
#include "libs/stream/stream_messages.h"
#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {

// What the live page shows beside the map: where the camera is and how the processes are.
class LiveInputs {
 public:
  void OnFramePose(const FramePose& pose) { pose_ = pose; }
  void OnHealth(const Health& health);

  struct Heard {
    Health health;
    std::chrono::steady_clock::time_point arrival;
  };

  // Before any was received, one with an empty state.
  const FramePose& Pose() const { return pose_; }
  const std::map<std::string, Heard>& HealthOf() const { return health_; }

 private:
  FramePose pose_;
  std::map<std::string, Heard> health_;  // by process name
};

// What the live page reads, as JSON: {state, headline, detail, figures[] {value, label, note}, pictures[] (SVG), graph
// (SVG), restoration[] {frame, event, L1, L2}, processes[] {name, state, message, age_s, cpu_s, rss_mb, note}, report
// (bool)}.
//   exported  the exports of this very map have been written
//   gaps_svg  what is to be flown again, drawn last; empty: nothing is drawn
std::string MakeLiveState(const MapModel& model, const LiveInputs& inputs, const GroundTruth* ground_truth,
                          bool exported, const std::string& gaps_svg = "");

}  // namespace mapmend

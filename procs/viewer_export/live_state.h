#pragma once

#include <chrono>
#include <map>
#include <string>

#include "libs/geometry/rigid3.h"
#include "procs/viewer_export/map_evaluation.h"

namespace mapmend {
class frame_pose_t;
class health_t;

// What the live page shows beside the map: where the camera is and how the processes are.
class LiveInputs {
 public:
  void OnFramePose(const frame_pose_t& message);
  void OnHealth(const health_t& message);

  struct FramePose {
    SubmapKey submap;   // submap id -1: not tracked
    std::string state;  // initialising, tracking, lost; empty: no pose was received
    int frame = -1;
    Rigid3 cam_from_submap;
    int num_inliers = 0;
  };
  struct Health {
    std::string state, message;
    double cpu_s = 0, rss_mb = 0;
    std::map<std::string, double> counters;
    std::chrono::steady_clock::time_point arrival;
  };

  const FramePose& Pose() const { return pose_; }
  const std::map<std::string, Health>& HealthOf() const { return health_; }

 private:
  FramePose pose_;
  std::map<std::string, Health> health_;  // by process name
};

// What the live page reads, as JSON: {state, headline, detail, figures[] {value, label, note}, pictures[] (SVG), graph
// (SVG), restoration[] {frame, event, L1, L2}, processes[] {name, state, message, age_s, cpu_s, rss_mb, note}, report
// (bool)}.
//   exported  the exports of this very map have been written
std::string MakeLiveState(const MapModel& model, const LiveInputs& inputs, const GroundTruth* ground_truth,
                          bool exported);

}  // namespace mapmend

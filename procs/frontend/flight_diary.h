#pragma once

#include <map>
#include <string>

#include "libs/base/event_log.h"
#include "libs/bus/health.h"
#include "procs/frontend/frontend.h"

namespace mapmend {

// Tells people what happens to tracking: a line in the log and an event for each loss, each frame found again, each
// submap; and how many frames had no pose when they came, by cause, in the counters of MAPMEND_HEALTH
// ("untracked.<cause>"; and of the last loss "lost_frame", "lost_utime": the last frame with a pose before it;
// "found_frame": the first one after it, -1 while it lasts). It changes nothing of the map.
class FlightDiary {
 public:
  FlightDiary(EventLog* events, HealthReporter* health) : events_(events), health_(health) {}

  void OnStart(const std::string& session, const std::string& source, int width, int height);
  void OnFrame(const Frame& frame, const FrameOutcome& outcome);
  // submap_begin: what Frontend::Finish returned.
  void OnFinished(int submap_begin);
  void OnEnd(int num_frames, int num_tracked, int64_t num_dropped);

  // Frames without a pose when they came, by FrameOutcome::cause.
  const std::map<std::string, int>& Untracked() const { return untracked_; }

 private:
  enum class Phase { kLooking, kTracking, kLost };

  void Count(const std::string& cause, int num_frames);
  void SetFound(int frame);
  // frame, utime: when it was believed.
  void NoteBegin(SubmapId submap, int first_frame, int frame, int64_t utime);
  void NoteLoss(const Frame& frame, const FrameOutcome& outcome);
  void CloseSubmap(const Frame& frame);

  EventLog* events_;
  HealthReporter* health_;
  Phase phase_ = Phase::kLooking;
  SubmapId submap_;      // tracked or lost
  int last_frame_ = -1;  // with a pose
  int64_t last_utime_ = 0;
  SubmapId last_submap_;  // of that frame
  std::string loss_cause_;
  bool any_submap_ = false;
  int unconfirmed_ = 0;  // frames with a pose in a submap that is not believed yet
  std::map<std::string, int> untracked_;
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "procs/frontend/record_publisher.h"
#include "procs/frontend/wide_extraction.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// Decides which images get wide features: those of the first and the last keyframes of submaps between which there is a
// gap, and those of photos in it that were not tracked. Until then it holds the images of the newest frames, and of
// keyframes that may be among a submap's first or last ones; others let go of theirs. Does nothing before Enable.
class WideRequests {
 public:
  explicit WideRequests(const WideFeaturesOptions& options) : options_(options) {}

  // extract is called in a thread of its own.
  void Enable(WideExtraction::Extract extract) { extraction_ = std::make_unique<WideExtraction>(std::move(extract)); }
  // What is not finished is forgotten, and nothing is requested any more.
  void GiveUp() { extraction_ = nullptr; }

  // map: the one that is tracked; null: none.
  void OnFrame(const FramePtr& frame, const WorkingMap* map);  // before it is tracked
  void OnKeyframe(const FramePtr& frame);
  // After OnFrame and what it led to: whether the frame has a pose in a submap that is believed.
  void AfterFrame(const FramePtr& frame, bool is_tracked);
  // The submap has come to be believed.  begin: time of its first frame
  void OnBelieved(int64_t begin);
  // A frame was tracked in a submap that is believed.
  void OnTracked(const WorkingMap& map);
  // All of the submap is published, its end is not.
  void OnEnd(const WorkingMap& map, bool is_lost);
  // The submap is no longer tracked: it has ended, or was a mistake.
  void OnLeft();

  // Records that are to be published now. What depends on nothing but the frames takes those that are due, and waits
  // for them; with a mapping thread those that are ready.
  RecordPublisher::Records TakeDue() { return Take(num_frames_); }
  RecordPublisher::Records TakeReady();
  RecordPublisher::Records TakeAll() { return Take(std::numeric_limits<int64_t>::max()); }

 private:
  RecordPublisher::Records Take(int64_t due);
  void RequestKeyframes(const WorkingMap& map, bool last);
  void LetGo(size_t num_held, const WorkingMap* map);

  WideFeaturesOptions options_;
  std::unique_ptr<WideExtraction> extraction_;
  int64_t num_frames_ = 0;
  bool first_requested_ = false;        // of the submap that is tracked
  std::set<KeyframeId> requested_;      // of it
  std::deque<FramePtr> newest_, held_;  // with images
  SubmapId closed_;                     // the last one that has ended; none: none yet
  std::vector<FramePtr> gap_;           // since its last frame, until a new one is believed
  bool gap_is_whole_ = false;           // gap_ holds all of them
};

}  // namespace mapmend

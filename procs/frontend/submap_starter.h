#pragma once

#include <memory>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/initializer.h"
#include "procs/frontend/keyframe_policy.h"
#include "procs/frontend/local_mapper.h"
#include "procs/frontend/record_publisher.h"
#include "procs/frontend/tracker.h"

namespace mapmend {

struct SubmapStarterOptions {
  InitializerOptions initializer;
  int max_misses = 3;  // frames before the beginning without a pose, one after the other, that end the way back

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("initializer", initializer);
    v("max_misses", max_misses, Range(1, 1000));
  }
};

// The map of two frames, bundle adjusted.
std::unique_ptr<WorkingMap> MapOfBeginning(const Initialization& initialization, SubmapId id, const Pyramid& pyramid,
                                           LocalMapper* mapper, IdSource* ids);

// The beginning of a submap (paper §3.1, §3.2): two frames that see the same ground from different places become its
// first keyframes; frames between and before them, which came without a pose, are tracked in it afterwards.
class SubmapStarter {
 public:
  // tracker, policy, mapper and publisher must outlive the starter.
  SubmapStarter(const SubmapStarterOptions& options, const Pinhole& camera, const Pyramid& pyramid,
                const Tracker* tracker, const KeyframePolicy* policy, LocalMapper* mapper, RecordPublisher* publisher)
      : options_(options),
        pyramid_(pyramid),
        initializer_(options.initializer, camera, pyramid),
        tracker_(tracker),
        policy_(policy),
        mapper_(mapper),
        publisher_(publisher) {}

  // A frame without a pose. With success, Start makes a submap of the two frames.
  Initialization AddFrame(const FramePtr& frame) { return initializer_.AddFrame(frame); }
  // A frame that was tracked in a submap that is not believed yet.
  void Keep(const FramePtr& frame) { initializer_.Keep(frame); }
  // As AddFrame, with a first frame that is kept.
  Initialization BeginWith(const FramePtr& first, const FramePtr& second) const {
    return initializer_.BeginWith(first, second);
  }
  // Null if bundle adjustment leaves too few points; then no id is used up. The frames with a pose are noted with the
  // publisher: the two first, then others.
  // frames: that may be seen from there, in order.
  std::unique_ptr<WorkingMap> Start(const Initialization& initialization, const std::deque<FramePtr>& frames,
                                    IdSource* ids);
  const std::deque<FramePtr>& Frames() const { return initializer_.Frames(); }
  // Forgets all frames.
  void Clear() { initializer_.Clear(); }
  // A submap that began with this frame was a mistake: the same two frames must not begin it again.
  void NoteMistake(const FramePtr& first);

 private:
  void TrackBetween(const Initialization& initialization, const std::deque<FramePtr>& frames, WorkingMap* map);
  void TrackBefore(const Initialization& initialization, const std::deque<FramePtr>& frames, WorkingMap* map);

  SubmapStarterOptions options_;
  Pyramid pyramid_;
  Initializer initializer_;
  const Tracker* tracker_;
  const KeyframePolicy* policy_;
  LocalMapper* mapper_;
  RecordPublisher* publisher_;
};

}  // namespace mapmend

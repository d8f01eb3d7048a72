#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/stream/records.h"
#include "procs/frontend/frame_refinement.h"
#include "procs/frontend/loss_reason.h"
#include "procs/frontend/tracker.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

class Vocabulary;

struct RecordPublisherOptions {
  // Frames that no keyframe follows (hovering) are published when so many wait, or, with a mapping thread, when the
  // first of them is so old: what was tracked must not be lost with the frontend.
  int max_waiting_frames = 30;
  double max_waiting_s = 0.4;
  FrameRefinementOptions refinement;  // of waiting frames, when a keyframe has joined the map
  // Frames of a young submap are kept after they were published, so that they can be told again.
  int max_keyframes_of_young = 160;
  int max_frames_of_young = 2000;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_waiting_frames", max_waiting_frames, Range(1, 100000));
    v("max_waiting_s", max_waiting_s, Range(0, 3600), "s");
    v("refinement", refinement);
    v("max_keyframes_of_young", max_keyframes_of_young, Range(0, 1e6), "keyframes");
    v("max_frames_of_young", max_frames_of_young, Range(0, 1e6), "frames");
  }
};

// Makes records of the stream of what happens to the submap that is tracked. Nothing of a submap is published before it
// is believed: it may turn out to be a mistake.
class RecordPublisher {
 public:
  using Emit = std::function<void(int64_t utime, RecordBody body)>;
  using Records = std::vector<std::pair<int64_t, RecordBody>>;

  // vocabulary may be null: then keyframes carry no words. It must outlive the publisher.
  RecordPublisher(const RecordPublisherOptions& options, const Pinhole& camera, const Pyramid& pyramid,
                  const Vocabulary* vocabulary, Emit emit)
      : options_(options),
        pyramid_(pyramid),
        refinement_(options.refinement, camera),
        vocabulary_(vocabulary),
        emit_(std::move(emit)) {}

  // take is given the original image of each keyframe before its record is emitted, by whichever thread publishes.
  using TakeImage = std::function<void(KeyframeId keyframe, const Frame& frame)>;
  void SetTakeImage(TakeImage take) { take_image_ = std::move(take); }

  // A submap that is not believed yet.
  void Begin();
  void Believe() { believed_ = true; }
  bool Believed() const { return believed_; }
  // The submap was a mistake: what was noted of it is forgotten.
  void Forget();
  // A frame with a pose, in the map that is tracked.
  void NoteFrame(const WorkingMap& map, const Frame& frame, const TrackResult& tracked);
  // The same of a frame that is a keyframe.
  void NoteKeyframe(const WorkingMap& map, KeyframeIndex keyframe);

  // The map is another one now, see SecondOpinion: its frames are placed in it, and published again. Those that it does
  // not see well enough lie between their neighbours in time.
  void OnReplaced(const WorkingMap& map, const std::vector<PointIndex>& new_of_old);

  // What is to be published up to a keyframe, which may still lack words; needs the map.
  Records Take(int64_t utime, KeyframeIndex last_keyframe, WorkingMap* map);
  // Adds the words and emits; needs no map.
  void EmitAll(Records&& records) const;
  void Publish(int64_t utime, WorkingMap* map) { EmitAll(Take(utime, map->LastKeyframe(), map)); }
  // Frames that have waited long enough for a keyframe, without what else has changed: that goes with the next one.
  //   is_live  see max_waiting_s
  void PublishWaitingFrames(int64_t utime, const WorkingMap& map, bool is_live);
  // The submap's end, after all of it was published.  last: its last frame
  void End(const Frame& last, LossReason reason, const std::string& detail, const WorkingMap& map) const;

  // Of those that are not published, the first frame with a pose.
  TrackedFrame FirstFrame() const;
  int NumTracked() const { return num_tracked_; }

 private:
  // A frame with a pose, and what else is asked of it until it is published.
  struct WaitingFrame {
    TrackedFrame frame;
    KeyframeIndex reference;
    std::vector<Sighting> sightings;
    bool is_keyframe = false;  // the reference itself
  };

  void Note(const WorkingMap& map, const Frame& frame, const Rigid3& cam_from_submap, KeyframeIndex reference,
            const std::vector<PointIndex>& points, bool is_keyframe);
  // Those that refer to keyframes up to this one, which are not waiting any more.
  std::vector<TrackedFrame> TakeFrames(KeyframeId last_published, const WorkingMap& map);
  // Keeps frames that were published while the submap is young.
  void KeepYoung(std::vector<WaitingFrame> frames, const WorkingMap& map);
  KeyframeRecord Describe(KeyframeIndex keyframe, const WorkingMap& map) const;
  void AddWords(KeyframeRecord* record) const;

  RecordPublisherOptions options_;
  Pyramid pyramid_;
  FrameRefinement refinement_;
  const Vocabulary* vocabulary_;
  Emit emit_;
  TakeImage take_image_;
  bool believed_ = false;
  KeyframeIndex next_keyframe_{0};    // the first one that is not published
  std::vector<WaitingFrame> frames_;  // not yet published
  std::vector<WaitingFrame> young_;   // published, of a young submap
  int num_tracked_ = 0;
};

}  // namespace mapmend

#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/stream/records.h"
#include "procs/frontend/initializer.h"
#include "procs/frontend/local_mapper.h"
#include "procs/frontend/loss_reason.h"
#include "procs/frontend/mapping_thread.h"
#include "procs/frontend/tracker.h"

namespace mapmend {

class Vocabulary;

struct FrontendOptions {
  InitializerOptions initializer;
  TrackerOptions tracker;
  LocalMapperOptions mapper;
  int max_lost_frames = 3;         // consecutive frames without orientation: the submap is closed (paper §3.2)
  int relocalisation_frames = 10;  // further frames in which the submap may be found again before it is closed
  double keyframe_ratio = 0.7;    // new keyframe when fewer points are seen than this share of the reference keyframe's
  int comfortable_inliers = 100;  // or fewer than this
  double keyframe_angle_deg = 3;  // or when the points are seen under an angle that differs by this much (median)
  // For a frame that is tracked afterwards: share of the image's cells that must hold an inlier, and the largest
  // standard deviation of its position, of the median depth.
  double min_spread_afterwards = 0.2;
  double max_position_sigma_afterwards = 0.008;
  double max_jump = 0.15;          // a step of this share of the scene's depth, and five times the last one, is a jump
  double jump_found_share = 0.15;  // of the points in view that must be found to believe a jump
  int confirm_frames = 2;          // frames that must be tracked in a new submap before it is believed
  bool mapping_thread = false;     // keyframes join the map while tracking goes on: fast, but the map depends on timing
  int max_unmapped_keyframes = 2;  // with mapping_thread: when more are not finished, tracking waits
  // Frames that no keyframe follows (hovering) are published when so many wait, or, with mapping_thread, when the first
  // of them is so old: what was tracked must not be lost with the frontend.
  int max_waiting_frames = 30;
  double max_waiting_s = 0.4;
};

enum class FrontendState { kInitialising, kTracking, kLost };

struct FrameOutcome {
  FrontendState state = FrontendState::kInitialising;
  TrackMethod method = TrackMethod::kNone;  // how tracking succeeded
  LossReason reason = LossReason::kNone;    // or why not
  // Why not, more exactly, for a diagnosis.
  LossReason cause = LossReason::kNone;
  LossReason abandoned =
      LossReason::kNone;  // with this frame a submap that was begun and not believed yet is given up: the cause
  int num_inliers = 0;
  bool keyframe = false;
  SubmapId submap;
  int submap_begin = -1;  // with this frame the submap is believed; its first frame (may be earlier). Else -1
  Rigid3 cam_from_submap;
  // Time spent. With a mapping thread, what tracking waited for it is in tracking_s.
  double tracking_s = 0, mapping_s = 0;
};

// Tracking, mapping and the life of submaps (paper §3.1, §3.2), without input or transport: frames go in in order,
// records of the stream come out through emit. Deterministic: equal frames and options give equal records, unless
// mapping has a thread of its own; then emit is called from that thread too, never from both at a time.
class Frontend {
 public:
  using Emit = std::function<void(int64_t utime, RecordBody body)>;
  // vocabulary may be null: then keyframes carry no words (for tests and tools). It must outlive the frontend.
  Frontend(const FrontendOptions& options, const Pinhole& camera, const Pyramid& pyramid, const Vocabulary* vocabulary,
           Emit emit);

  // Before the first frame: ids that an earlier frontend of the same session has used are not used again.
  void ContinueAfter(const IdSource& ids) { ids_ = ids; }
  // With a mapping thread, throws what that threw.
  FrameOutcome ProcessFrame(const FramePtr& frame);
  // Closes the current submap at the end of the input.
  void Finish();

  int NumSubmaps() const { return ids_.next_submap; }
  int NumKeyframes() const { return ids_.next_keyframe; }
  int NumTracked() const { return num_tracked_; }
  int NumLosses() const { return num_losses_; }

 private:
  FrameOutcome Initialise(const FramePtr& frame);
  FrameOutcome TrackFrame(const FramePtr& frame);
  // Starts a submap if initialisation has succeeded, and says so in the outcome of its second frame.
  void Begin(const Initialization& initialization, FrameOutcome* outcome);
  bool StartSubmap(const Initialization& initialization);
  LossReason InitialCause(const Frame& frame, const Initialization& initialization) const;
  LossReason ExplainFailure(const Frame& frame, LossReason tracker_reason) const;
  bool NeedsKeyframe(const Frame& frame, const TrackResult& result) const;
  void InsertKeyframe(const FramePtr& frame);
  void MapKeyframe(int keyframe, MapLock* lock);
  void WaitForMapping(size_t unfinished_keyframes = 0);
  void CloseSubmap(LossReason reason, const std::string& detail);
  void AbandonSubmap();
  void NoteFrame(const Frame& frame, int reference_keyframe);
  // What is to be published up to a keyframe, which may still lack words; then words and emission, for which the map is
  // not needed.
  std::vector<std::pair<int64_t, RecordBody>> TakeRecords(int64_t utime, int last_keyframe);
  void EmitRecords(std::vector<std::pair<int64_t, RecordBody>> records);
  void Publish(int64_t utime);
  void PublishWaitingFrames(int64_t utime);
  std::optional<Rigid3> Predict(int64_t utime) const;
  TrackResult TrackAfterwards(const std::vector<int>& hints, Frame* frame);
  bool IsJump(const Frame& frame) const;

  FrontendOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  const Vocabulary* vocabulary_;
  Emit emit_;
  Initializer initializer_;
  Tracker tracker_;
  LocalMapper mapper_;
  IdSource ids_;

  std::unique_ptr<WorkingMap> map_;
  bool confirmed_ = false;
  int frames_since_start_ = 0;
  int lost_frames_ = 0;
  std::vector<FramePtr> lost_;  // frames that failed since the last success
  LossReason last_failure_ = LossReason::kNone;
  FramePtr last_frame_, before_last_frame_;  // tracked ones
  int last_keyframe_ = -1;
  int last_reference_ = -1;
  int first_unpublished_keyframe_ = 0;
  std::vector<TrackedFrame> tracked_frames_;  // not yet published
  int num_tracked_ = 0, num_losses_ = 0;
  double mapping_s_ = 0;                    // of the current frame
  MapLock lock_;                            // while a frame is processed
  std::unique_ptr<MappingThread> mapping_;  // null: keyframes join the map in ProcessFrame. Ends before the rest does
};

}  // namespace mapmend

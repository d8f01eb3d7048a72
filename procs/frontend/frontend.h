#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/stream/records.h"
#include "procs/frontend/beginning_trial.h"
#include "procs/frontend/keyframe_policy.h"
#include "procs/frontend/local_mapper.h"
#include "procs/frontend/loss_diagnosis.h"
#include "procs/frontend/mapping_thread.h"
#include "procs/frontend/motion_model.h"
#include "procs/frontend/record_publisher.h"
#include "procs/frontend/relocaliser.h"
#include "procs/frontend/second_opinion.h"
#include "procs/frontend/sparse_photos.h"
#include "procs/frontend/submap_starter.h"
#include "procs/frontend/tracker.h"
#include "procs/frontend/wide_requests.h"

namespace mapmend {

class Vocabulary;

struct FrontendOptions {
  SubmapStarterOptions starter;
  BeginningTrialOptions trial;
  SecondOpinionOptions second_opinion;
  TrackerOptions tracker;
  LocalMapperOptions mapper;
  MotionModelOptions motion;
  KeyframePolicyOptions keyframes;
  LossDiagnosisOptions diagnosis;
  RecordPublisherOptions publishing;
  WideFeaturesOptions wide;
  SparsePhotosOptions sparse;
  RelocaliserOptions relocaliser;
  // After a loss no new submap is begun: the camera waits until it sees the map again, as with ORB-SLAM2. The baseline
  // of the paper (§4).
  bool relocalise_only = false;
  int max_lost_frames = 3;         // consecutive frames without orientation: the submap is closed (paper §3.2)
  int relocalisation_frames = 10;  // further frames in which the submap may be found again before it is closed
  double jump_found_share = 0.15;  // of the points in view that must be found to believe a jump
  int confirm_frames = 2;          // frames that must be tracked in a new submap before it is believed, at least
  bool mapping_thread = false;     // keyframes join the map while tracking goes on: fast, but the map depends on timing
  int max_unmapped_keyframes = 2;  // with mapping_thread: when more are not finished, tracking waits

  // Not visited: mapping_thread: follows from how images come.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("starter", starter);
    v("trial", trial);
    v("second_opinion", second_opinion);
    v("tracker", tracker);
    v("mapper", mapper);
    v("motion", motion);
    v("keyframes", keyframes);
    v("diagnosis", diagnosis);
    v("publishing", publishing);
    v("wide", wide);
    v("sparse", sparse);
    v("relocaliser", relocaliser);
    v("relocalise_only", relocalise_only);
    v("max_lost_frames", max_lost_frames, Range(1, 100000), "frames");
    v("relocalisation_frames", relocalisation_frames, Range(0, 100000), "frames");
    v("jump_found_share", jump_found_share, Range(0, 10), "of the points in view");
    v("confirm_frames", confirm_frames, Range(0, 10000), "frames");
    v("max_unmapped_keyframes", max_unmapped_keyframes, Range(0, 10000), "keyframes");
  }
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
  using Emit = RecordPublisher::Emit;
  // vocabulary may be null: then keyframes carry no words (for tests and tools). It must outlive the frontend.
  Frontend(const FrontendOptions& options, const Pinhole& camera, const Pyramid& pyramid, const Vocabulary* vocabulary,
           Emit emit);

  // Before the first frame: ids that an earlier frontend of the same session has used are not used again.
  void ContinueAfter(const IdSource& ids) { ids_ = ids; }
  // Before the first frame: the beginnings and ends of submaps get wide features if there is a gap to be bridged, an
  // earlier submap or a loss. extract is called in a thread of its own.
  void ExtractWideFeatures(WideExtraction::Extract extract) { wide_.Enable(std::move(extract)); }
  // Before the first frame: photos that ORB cannot follow are tracked with wide features, which convert gives them.
  void ConvertSparsePhotos(SparsePhotos::Convert convert) { sparse_.Enable(std::move(convert)); }
  // Before the first frame: take gets the original image of every keyframe that is published; it must not wait.
  void TakeImages(RecordPublisher::TakeImage take) { publisher_.SetTakeImage(std::move(take)); }
  // With a mapping thread, throws what that threw.
  FrameOutcome ProcessFrame(const FramePtr& frame);
  // Closes the current submap at the end of the input. in_haste: wide features that are not finished are given up.
  // Returns the first frame of a submap that is believed only now, else -1.
  int Finish(bool in_haste = false);

  int NumSubmaps() const { return ids_.next_submap; }
  int NumKeyframes() const { return ids_.next_keyframe; }
  int NumTracked() const { return publisher_.NumTracked(); }
  int NumLosses() const { return num_losses_; }

 private:
  // Frames that failed since the last one that was tracked.
  struct LostFrames {
    std::vector<FramePtr> frames;
    int count = 0;  // also of those that are not kept any more
    // The first frame tells best why tracking was lost: after a gap or a dark spell the next ones look well.
    LossReason reason = LossReason::kNone;
    int Count() const { return count; }
  };

  FrameOutcome Initialise(const FramePtr& frame);
  FrameOutcome TrackFrame(const FramePtr& photo);
  TrackResult Track(const FramePtr& frame);
  TrackResult TrackSparse(const FramePtr& frame);
  std::vector<KeyframeIndex> Hints(int num_newest) const;
  // With the third photo of a beginning, in the submap of the other two.
  FrameOutcome TrackThird(const FramePtr& photo);
  FrameOutcome OnTracked(const FramePtr& frame, const TrackResult& result);
  FrameOutcome OnLost(const FramePtr& frame, LossReason reason);
  // Of a believed submap, with relocalise_only.
  void WaitToRelocalise();
  // Tries all ways to begin a submap with this frame.
  Initialization AddToBeginning(const FramePtr& frame);
  void ClearBeginning();
  int ConfirmFrames() const { return IsSparse(*map_) ? options_.sparse.confirm_frames : options_.confirm_frames; }
  // Starts a submap if initialisation has succeeded, and says so in the outcome of its second frame.
  void Begin(const Initialization& initialization, FrameOutcome* outcome);
  // Whether a new submap is to be believed with this frame. It may be begun anew instead, and says so in the outcome.
  bool BeginningStands(const FramePtr& frame, const TrackResult& tracked, FrameOutcome* outcome);
  // Photos that had no pose when they came, and may be seen from the newest keyframe.
  void RecoverLeftovers();
  // Frames that failed before one that was tracked may be seen from there.
  void TrackLostFrames();
  double MedianDepth(const TrackResult& tracked) const;
  bool NeedsKeyframe(const TrackResult& tracked) const;
  void InsertKeyframe(const FramePtr& frame, const TrackResult& tracked);
  void MapKeyframe(KeyframeIndex keyframe, MapLock* lock);
  void SeekSecondOpinion();
  void WaitForMapping(size_t unfinished_keyframes = 0);
  // Wide features that are to be published with this frame.
  void EmitWide();
  // The submap is believed from now on. Returns its first frame.
  int Believe(int64_t utime);
  void CloseSubmap(LossReason reason, const std::string& detail);
  // Of a submap that is not believed: the second keeps the frames, to begin anew.
  void AbandonSubmap();
  void GiveUpBeginning();
  void LeaveSubmap();

  FrontendOptions options_;
  Tracker tracker_;
  LocalMapper mapper_;
  LossDiagnosis diagnosis_;
  KeyframePolicy keyframes_;
  RecordPublisher publisher_;
  SubmapStarter starter_;
  BeginningTrial trial_;
  SecondOpinion second_opinion_;
  Relocaliser relocaliser_;
  WideRequests wide_;
  SparsePhotos sparse_;
  IdSource ids_;

  std::unique_ptr<WorkingMap> map_;  // null: no submap is tracked
  MotionModel motion_;
  LostFrames lost_;
  int frames_since_start_ = 0;
  KeyframeIndex last_keyframe_;
  KeyframeIndex last_reference_;
  int num_losses_ = 0;
  double mapping_s_ = 0;                    // of the current frame
  MapLock lock_;                            // while a frame is processed
  std::unique_ptr<MappingThread> mapping_;  // null: keyframes join the map in ProcessFrame. Ends before the rest does
};

}  // namespace mapmend

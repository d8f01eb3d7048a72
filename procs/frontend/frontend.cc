#include "procs/frontend/frontend.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "procs/frontend/profiler.h"
#include "procs/frontend/reach.h"

namespace mapmend {
namespace {

constexpr int kNumHints = 3;  // newest keyframes that a frame is matched with

// Holds a lock in its scope, if there is anything to lock.
class Locked {
 public:
  explicit Locked(MapLock* lock) : lock_(lock->mutex() != nullptr ? lock : nullptr) {
    const StageTimer timer(lock_ != nullptr ? "track/map_lock" : nullptr);
    if (lock_ != nullptr) lock_->lock();
  }
  ~Locked() {
    if (lock_ != nullptr && lock_->owns_lock()) lock_->unlock();
  }
  Locked(const Locked&) = delete;
  Locked& operator=(const Locked&) = delete;

 private:
  MapLock* lock_;
};

}  // namespace

Frontend::Frontend(const FrontendOptions& options, const Pinhole& camera, const Pyramid& pyramid,
                   const Vocabulary* vocabulary, Emit emit)
    : options_(options),
      tracker_(options.tracker, camera, pyramid),
      mapper_(options.mapper, camera, pyramid),
      diagnosis_(options.diagnosis, camera.width),
      keyframes_(options.keyframes),
      publisher_(options.publishing, camera, pyramid, vocabulary, std::move(emit)),
      starter_(options.starter, camera, pyramid, &tracker_, &keyframes_, &mapper_, &publisher_),
      trial_(options.trial, camera),
      second_opinion_(options.second_opinion, options.starter.initializer, camera, pyramid, &tracker_, &mapper_),
      relocaliser_(options.relocaliser, vocabulary),
      wide_(options.wide),
      sparse_(options.sparse, camera, pyramid),
      motion_(options.motion) {
  if (!options.mapping_thread) return;
  mapping_ =
      std::make_unique<MappingThread>([this](KeyframeIndex keyframe, MapLock* lock) { MapKeyframe(keyframe, lock); });
  lock_ = MapLock(mapping_->Mutex(), std::defer_lock);
}

FrameOutcome Frontend::ProcessFrame(const FramePtr& frame) {
  const StageTimer timer(mapping_ ? "track/frame" : "track+map/frame");
  const auto begin = std::chrono::steady_clock::now();
  const Locked locked(&lock_);
  mapping_s_ = 0;
  EmitWide();
  wide_.OnFrame(frame, map_.get());
  sparse_.OnFrame(frame);
  FrameOutcome outcome = map_ ? TrackFrame(frame) : Initialise(frame);
  wide_.AfterFrame(frame, map_ && publisher_.Believed() && lost_.Count() == 0);
  outcome.mapping_s = mapping_s_;
  outcome.tracking_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() - mapping_s_;
  return outcome;
}

// Records must not be emitted by two threads at a time, and of a frontend without a mapping thread always in the same
// order.
void Frontend::EmitWide() {
  if (mapping_ && mapping_->NumUnfinished() > 0) return;
  publisher_.EmitAll(mapping_ ? wide_.TakeReady() : wide_.TakeDue());
}

FrameOutcome Frontend::Initialise(const FramePtr& frame) {
  const StageTimer timer("track/initialise");
  FrameOutcome outcome;
  const Initialization initialization = AddToBeginning(frame);
  outcome.reason = initialization.reason;
  outcome.cause =
      diagnosis_.OfBeginning(*frame, initialization.success ? LossReason::kNotConfirmed : initialization.cause);
  Begin(initialization, &outcome);
  return map_ && IsSparse(*map_) ? TrackThird(frame) : outcome;
}

Initialization Frontend::AddToBeginning(const FramePtr& frame) {
  const FramePtr& photo = HolderOf(frame);
  if (sparse_.HaveTakenOver()) return sparse_.AddFrame(photo);
  const Initialization dense = starter_.AddFrame(photo);
  if (dense.success) {
    sparse_.Keep(photo);
    return dense;
  }
  const Initialization sparse = sparse_.AddFrame(photo);
  return sparse.success ? sparse : dense;
}

void Frontend::ClearBeginning() {
  starter_.Clear();
  sparse_.ClearBeginning();
}

void Frontend::Begin(const Initialization& initialization, FrameOutcome* outcome) {
  if (!initialization.success) return;
  const bool is_sparse = initialization.first->photo != nullptr;
  std::unique_ptr<WorkingMap> map =
      starter_.Start(initialization, is_sparse ? sparse_.Frames() : starter_.Frames(), &ids_);
  if (!map) return;
  map_ = std::move(map);
  trial_.Begin(initialization, *map_);
  second_opinion_.Begin();
  for (const WorkingKeyframe& keyframe : map_->Keyframes()) wide_.OnKeyframe(keyframe.frame);
  frames_since_start_ = 0;
  lost_ = {};
  last_keyframe_ = last_reference_ = KeyframeIndex(1);
  if (is_sparse) sparse_.OnBegin(*map_);
  const Rigid3& pose = map_->Keyframe(last_keyframe_).cam_from_submap;
  motion_.Clear();
  motion_.Add(initialization.second, pose, last_keyframe_, false);
  outcome->state = FrontendState::kTracking;
  outcome->method = TrackMethod::kInitialised;
  outcome->cause = LossReason::kNone;
  outcome->keyframe = true;
  outcome->submap = map_->Id();
  outcome->cam_from_submap = pose;
  outcome->num_inliers = static_cast<int>(initialization.points.size());
}

// A beginning of photos came of three: the newest must be seen in the map of the other two.
FrameOutcome Frontend::TrackThird(const FramePtr& photo) {
  const FramePtr frame = sparse_.Converted(HolderOf(photo));
  const TrackResult result = Track(frame);
  if (result.success) return OnTracked(frame, result);
  AbandonSubmap();
  FrameOutcome outcome;
  outcome.reason = result.reason;
  outcome.abandoned = outcome.cause = diagnosis_.OfBeginning(*HolderOf(frame), diagnosis_.OfGivingUp(result.reason));
  return outcome;
}

FrameOutcome Frontend::TrackFrame(const FramePtr& photo) {
  const FramePtr frame = IsSparse(*map_) ? sparse_.Converted(photo) : photo;
  const TrackResult result = Track(frame);
  return result.success ? OnTracked(frame, result) : OnLost(frame, result.reason);
}

double Frontend::MedianDepth(const TrackResult& tracked) const {
  std::vector<double> depths;
  for (const PointIndex p : tracked.points) {
    if (!p.IsNone()) depths.push_back((tracked.cam_from_submap * map_->Point(p).position).z());
  }
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  return depths[depths.size() / 2];
}

std::vector<KeyframeIndex> Frontend::Hints(int num_newest) const {
  std::vector<KeyframeIndex> hints = {last_reference_};
  for (KeyframeIndex k = last_keyframe_; !k.IsNone() && last_keyframe_ - k < num_newest; --k) {
    if (k != last_reference_ && !map_->Keyframe(k).removed) hints.push_back(k);
  }
  return hints;
}

TrackResult Frontend::Track(const FramePtr& frame) {
  std::vector<KeyframeIndex> hints = Hints(kNumHints);
  const bool relocalises = options_.relocalise_only && lost_.Count() >= options_.max_lost_frames;
  if (relocalises) {
    const std::vector<KeyframeIndex> alike = relocaliser_.Candidates(*map_, *frame);
    hints.insert(hints.end(), alike.begin(), alike.end());
  }
  motion_.Refresh(*map_);
  const std::optional<Rigid3> prediction = lost_.Count() == 0 ? motion_.Predict(frame->utime) : std::nullopt;
  TrackResult result = IsSparse(*map_) ? TrackSparse(frame) : tracker_.Track(prediction, hints, *frame, map_.get());
  if (result.success && relocalises && result.num_inliers < options_.relocaliser.min_inliers) {
    result.success = false;
    result.reason = LossReason::kTooFewInliers;
  }
  if (result.success && prediction && motion_.IsJump(result.cam_from_submap, MedianDepth(result)) &&
      result.num_inliers < options_.jump_found_share * result.num_visible) {
    result.success = false;
    result.reason = LossReason::kInconsistentMotion;
  }
  return result;
}

// With all keyframes, as strips lie side by side; where that leads too far away, with the newest ones.
TrackResult Frontend::TrackSparse(const FramePtr& frame) {
  TrackResult elsewhere;
  elsewhere.reason = LossReason::kInconsistentMotion;
  bool is_elsewhere = false;
  for (const int num_newest : {options_.sparse.max_keyframes, kNumHints}) {
    const std::vector<KeyframeIndex> hints = Hints(num_newest);
    const TrackResult result = sparse_.Track(tracker_, hints, frame, map_.get());
    if (!result.success) return is_elsewhere ? elsewhere : result;
    if (IsWithinReach(*map_, frame->utime, result.cam_from_submap.Center(), options_.sparse.max_speed)) return result;
    is_elsewhere = true;
  }
  return elsewhere;
}

FrameOutcome Frontend::OnTracked(const FramePtr& frame, const TrackResult& result) {
  FrameOutcome outcome;
  outcome.submap = map_->Id();
  outcome.state = FrontendState::kTracking;
  outcome.method = result.method;
  outcome.num_inliers = result.num_inliers;
  const bool follows = lost_.Count() == 0;
  if (IsSparse(*map_)) sparse_.OnPose(frame);
  last_reference_ = result.reference_keyframe;
  ++frames_since_start_;
  TrackLostFrames();
  outcome.keyframe = NeedsKeyframe(result);
  outcome.cam_from_submap = result.cam_from_submap;
  if (outcome.keyframe) {
    InsertKeyframe(frame, result);
    outcome.cam_from_submap = map_->Keyframe(last_keyframe_).cam_from_submap;
  } else {
    publisher_.NoteFrame(*map_, *frame, result);
    // A keyframe at hand publishes them anyway, and records must not be emitted by two threads at a time.
    if (!mapping_ || mapping_->NumUnfinished() == 0)
      publisher_.PublishWaitingFrames(frame->utime, *map_, mapping_ != nullptr);
  }
  motion_.Add(frame, outcome.cam_from_submap, outcome.keyframe ? last_keyframe_ : KeyframeIndex(), follows);
  if (!publisher_.Believed()) {
    if (BeginningStands(frame, result, &outcome)) outcome.submap_begin = Believe(frame->utime);
    if (!IsSparse(*map_)) starter_.Keep(frame);
    sparse_.Keep(frame);
  }
  if (outcome.keyframe && publisher_.Believed() && IsSparse(*map_)) RecoverLeftovers();
  if (publisher_.Believed()) wide_.OnTracked(*map_);
  return outcome;
}

bool Frontend::BeginningStands(const FramePtr& frame, const TrackResult& tracked, FrameOutcome* outcome) {
  if (frames_since_start_ < ConfirmFrames()) return false;
  if (IsSparse(*map_)) return true;
  const BeginningTrial::Verdict verdict = trial_.Next(tracked.cam_from_submap, tracked.points, *map_);
  if (verdict != BeginningTrial::Verdict::kAsk) return verdict == BeginningTrial::Verdict::kStands;
  const StageTimer timer("track/trial");
  const Initialization wider = starter_.BeginWith(map_->Keyframe(KeyframeIndex(0)).frame, frame);
  if (wider.reason == LossReason::kTooFewMatches) return true;
  if (!wider.success) {
    trial_.Postpone();
    return false;
  }
  if (!trial_.Contradicts(wider, tracked.cam_from_submap, *map_)) return true;
  GiveUpBeginning();
  *outcome = FrameOutcome();
  outcome->abandoned = outcome->reason = outcome->cause = LossReason::kAmbiguous;
  Begin(wider, outcome);
  return false;
}

// A photo that is found leads on to others.
void Frontend::RecoverLeftovers() {
  const StageTimer timer("track/leftovers");
  const KeyframeIndex last_keyframe = last_keyframe_, last_reference = last_reference_;
  for (KeyframeIndex k = last_keyframe; k <= map_->LastKeyframe(); ++k) {
    for (const FramePtr& frame : sparse_.Leftovers(*map_->Keyframe(k).frame)) {
      const TrackResult result = sparse_.Track(tracker_, {k}, frame, map_.get());
      if (!result.success ||
          !IsWithinReach(*map_, frame->utime, result.cam_from_submap.Center(), options_.sparse.max_speed)) {
        continue;
      }
      InsertKeyframe(frame, result);
      sparse_.OnPose(frame);
    }
  }
  last_keyframe_ = last_keyframe;
  last_reference_ = last_reference;
}

void Frontend::TrackLostFrames() {
  std::reverse(lost_.frames.begin(), lost_.frames.end());
  for (const FramePtr& frame : lost_.frames) {
    const TrackResult result = tracker_.TrackAfterwards({last_reference_, last_keyframe_}, *frame, map_.get());
    if (result.success) publisher_.NoteFrame(*map_, *frame, result);
  }
  lost_ = {};
}

int Frontend::Believe(int64_t utime) {
  WaitForMapping();
  publisher_.Believe();
  const TrackedFrame first = publisher_.FirstFrame();
  ClearBeginning();
  if (IsSparse(*map_)) sparse_.OnBelieved();
  trial_.Clear();
  wide_.OnBelieved(first.utime);
  publisher_.Publish(utime, map_.get());
  return first.frame;
}

FrameOutcome Frontend::OnLost(const FramePtr& frame, LossReason reason) {
  FrameOutcome outcome;
  outcome.submap = map_->Id();
  outcome.state = FrontendState::kLost;
  outcome.reason = outcome.cause = diagnosis_.OfTracking(*frame, motion_, reason);
  if (lost_.Count() == 0) lost_.reason = outcome.reason;
  lost_.frames.push_back(frame);
  ++lost_.count;
  if (!publisher_.Believed() && frames_since_start_ >= ConfirmFrames())
    outcome.submap_begin = Believe(motion_.Last()->utime);  // it cannot be asked any more
  if (!publisher_.Believed()) {
    const LossReason cause = diagnosis_.OfGivingUp(outcome.cause);
    AbandonSubmap();
    outcome = Initialise(frame);
    outcome.abandoned = cause;
    if (outcome.cause != LossReason::kNone) outcome.cause = cause;
    return outcome;
  }
  if (options_.relocalise_only) {
    WaitToRelocalise();
    return outcome;
  }
  if (lost_.Count() == 1) ClearBeginning();
  // A new submap is begun while the old one may still be found again: whichever succeeds first wins.
  const Initialization initialization = AddToBeginning(frame);
  if (lost_.Count() < options_.max_lost_frames) return outcome;
  if (initialization.success || lost_.Count() >= options_.max_lost_frames + options_.relocalisation_frames) {
    CloseSubmap(lost_.reason, std::to_string(lost_.Count()) + " consecutive frames without orientation");
    Begin(initialization, &outcome);
    if (map_ && IsSparse(*map_)) return TrackThird(frame);
  }
  return outcome;
}

void Frontend::WaitToRelocalise() {
  if (lost_.Count() < options_.max_lost_frames) return;
  num_losses_ += lost_.Count() == options_.max_lost_frames;
  lost_.frames.clear();  // what lies before the place where it is found again stays missing
}

bool Frontend::NeedsKeyframe(const TrackResult& tracked) const {
  if (!tracked.new_points.empty()) return true;
  const bool is_busy = mapping_ && mapping_->NumUnfinished() > 0;
  if (is_busy && !keyframes_.IsUrgent(tracked.num_inliers)) return false;
  return keyframes_.NeedsKeyframe(keyframes_.Measure(*map_, tracked));
}

void Frontend::InsertKeyframe(const FramePtr& frame, const TrackResult& tracked) {
  last_keyframe_ = map_->AddKeyframe(frame, tracked.cam_from_submap, tracked.points);
  last_reference_ = last_keyframe_;
  for (const InitialPoint& p : tracked.new_points) {
    const PointIndex point = map_->AddPoint(p.position, tracked.reference_keyframe);
    map_->AddObservation(point, tracked.reference_keyframe, p.first_feature);
    map_->AddObservation(point, last_keyframe_, p.second_feature);
    map_->RefreshPoint(point);
  }
  wide_.OnKeyframe(frame);
  publisher_.NoteKeyframe(*map_, last_keyframe_);
  if (mapping_) {
    mapping_->Push(last_keyframe_);
    WaitForMapping(static_cast<size_t>(options_.max_unmapped_keyframes));
    return;
  }
  const auto begin = std::chrono::steady_clock::now();
  mapper_.Process(last_keyframe_, map_.get());
  SeekSecondOpinion();
  publisher_.Publish(frame->utime, map_.get());
  mapping_s_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// In the mapping thread.
void Frontend::MapKeyframe(KeyframeIndex keyframe, MapLock* lock) {
  const StageTimer timer("map/keyframe");
  const int64_t utime = map_->Keyframe(keyframe).frame->utime;
  mapper_.Process(keyframe, map_.get(), lock);
  SeekSecondOpinion();
  RecordPublisher::Records records = publisher_.Take(utime, keyframe, map_.get());
  lock->unlock();
  publisher_.EmitAll(std::move(records));
  lock->lock();
}

void Frontend::SeekSecondOpinion() {
  if (IsSparse(*map_)) return;  // three photos have agreed
  if (const auto new_of_old = second_opinion_.Seek(map_.get())) publisher_.OnReplaced(*map_, *new_of_old);
}

void Frontend::WaitForMapping(size_t unfinished_keyframes) {
  const StageTimer timer(mapping_ ? "track/map_backlog" : nullptr);
  if (mapping_) mapping_->WaitUntilLeft(unfinished_keyframes, &lock_);
}

void Frontend::AbandonSubmap() {
  if (IsSparse(*map_)) {
    sparse_.NoteMistake(*map_);
  } else {
    starter_.NoteMistake(map_->Keyframes().front().frame);
  }
  trial_.Clear();
  GiveUpBeginning();
}

void Frontend::GiveUpBeginning() {
  WaitForMapping();
  publisher_.Forget();
  ids_.next_submap = map_->Id().value;
  LeaveSubmap();
}

void Frontend::CloseSubmap(LossReason reason, const std::string& detail) {
  WaitForMapping();
  publisher_.Publish(motion_.Last()->utime, map_.get());
  wide_.OnEnd(*map_, reason != LossReason::kEndOfInput);
  publisher_.End(*motion_.Last(), reason, detail, *map_);
  ++num_losses_;
  LeaveSubmap();
}

void Frontend::LeaveSubmap() {
  map_.reset();
  wide_.OnLeft();
  relocaliser_.Clear();
  motion_.Clear();
  lost_ = {};
}

int Frontend::Finish(bool in_haste) {
  const Locked locked(&lock_);
  if (in_haste) wide_.GiveUp();
  int submap_begin = -1;
  if (map_ && !publisher_.Believed() && frames_since_start_ >= ConfirmFrames())
    submap_begin = Believe(motion_.Last()->utime);
  if (map_ && publisher_.Believed()) {
    const int losses = num_losses_;
    CloseSubmap(LossReason::kEndOfInput, "the input ended");
    num_losses_ = losses;
  } else if (map_) {
    AbandonSubmap();
  }
  publisher_.EmitAll(wide_.TakeAll());
  return submap_begin;
}

}  // namespace mapmend

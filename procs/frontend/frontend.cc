#include "procs/frontend/frontend.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "libs/geometry/triangulation.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr double kMaxTimeRatio = 2.5;  // the motion model does not reach over longer gaps
constexpr double kDark = 12;           // mean grey level
constexpr double kBlurred = 0.4;       // sharpness, of the last good frame's
constexpr double kUnsharp = 3;         // sharpness below which an image that starts no map is called blurred
constexpr int kSmallImage = 200;       // pixels: poses from narrower images are too uncertain to be believed
constexpr double kGap = 5;             // time since the last frame, of the usual time between frames

// cam_from_submap after time_ratio times the motion from before to last.
Rigid3 Extrapolate(const Rigid3& before, const Rigid3& last, double time_ratio) {
  const Rigid3 motion = last * before.Inverse();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::Identity().slerp(time_ratio, motion.rotation);
  return Rigid3(turn, time_ratio * motion.translation) * last;
}

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
      camera_(camera),
      pyramid_(pyramid),
      vocabulary_(vocabulary),
      emit_(std::move(emit)),
      initializer_(options.initializer, camera, pyramid),
      tracker_(options.tracker, camera, pyramid),
      mapper_(options.mapper, camera, pyramid) {
  if (!options.mapping_thread) return;
  mapping_ = std::make_unique<MappingThread>([this](int keyframe, MapLock* lock) { MapKeyframe(keyframe, lock); });
  lock_ = MapLock(mapping_->Mutex(), std::defer_lock);
}

FrameOutcome Frontend::ProcessFrame(const FramePtr& frame) {
  frame->points.assign(frame->features.Size(), -1);
  const StageTimer timer(mapping_ ? "track/frame" : "track+map/frame");
  const auto begin = std::chrono::steady_clock::now();
  const Locked locked(&lock_);
  mapping_s_ = 0;
  FrameOutcome outcome = map_ ? TrackFrame(frame) : Initialise(frame);
  outcome.mapping_s = mapping_s_;
  outcome.tracking_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() - mapping_s_;
  return outcome;
}

FrameOutcome Frontend::Initialise(const FramePtr& frame) {
  const StageTimer timer("track/initialise");
  FrameOutcome outcome;
  const Initialization initialization = initializer_.AddFrame(frame);
  outcome.reason = initialization.reason;
  outcome.cause = initialization.success ? LossReason::kNotConfirmed : InitialCause(*frame, initialization);
  Begin(initialization, &outcome);
  return outcome;
}

void Frontend::Begin(const Initialization& initialization, FrameOutcome* outcome) {
  if (!initialization.success || !StartSubmap(initialization)) return;
  outcome->state = FrontendState::kTracking;
  outcome->method = TrackMethod::kInitialised;
  outcome->cause = LossReason::kNone;
  outcome->keyframe = true;
  outcome->submap = map_->Id();
  outcome->cam_from_submap = initialization.second->cam_from_submap;
  outcome->num_inliers = static_cast<int>(initialization.points.size());
}

bool Frontend::StartSubmap(const Initialization& initialization) {
  const IdSource ids_before = ids_;
  auto map = std::make_unique<WorkingMap>(SubmapId(ids_.next_submap), pyramid_, &ids_);
  const FramePtr &first = initialization.first, &second = initialization.second;
  first->points.assign(first->features.Size(), -1);
  second->points.assign(second->features.Size(), -1);
  first->cam_from_submap = Rigid3();
  second->cam_from_submap = initialization.second_from_first;
  const int k0 = map->AddKeyframe(first), k1 = map->AddKeyframe(second);
  for (const InitialPoint& p : initialization.points) {
    const int point = map->AddPoint(p.position, k0);
    map->AddObservation(point, k0, p.first_feature);
    map->AddObservation(point, k1, p.second_feature);
    map->RefreshPoint(point);
  }
  mapper_.AdjustAll(map.get());
  if (map->NumPoints() < options_.initializer.min_points) {
    ids_ = ids_before;
    return false;
  }
  ++ids_.next_submap;
  map_ = std::move(map);
  confirmed_ = false;
  frames_since_start_ = 0;
  lost_frames_ = 0;
  lost_.clear();
  first_unpublished_keyframe_ = 0;
  tracked_frames_.clear();
  NoteFrame(*first, k0);
  NoteFrame(*second, k1);
  last_keyframe_ = last_reference_ = k1;
  before_last_frame_ = nullptr;
  last_frame_ = second;
  // Frames between the two, then those before the first, backwards: they saw the same ground.
  std::vector<FramePtr> before, between;
  bool past_first = false;
  for (const FramePtr& f : initializer_.Frames()) {
    if (f == first)
      past_first = true;
    else if (f != second)
      (past_first ? between : before).push_back(f);
  }
  for (const FramePtr& f : between) {
    const TrackResult result = TrackAfterwards({k0, k1}, f.get());
    if (result.success) NoteFrame(*f, result.reference_keyframe);
  }
  std::reverse(before.begin(), before.end());
  int hint = k0, misses = 0;
  for (const FramePtr& f : before) {
    const TrackResult result = TrackAfterwards({hint}, f.get());
    if (!result.success) {
      if (++misses == options_.max_lost_frames) break;
      continue;
    }
    misses = 0;
    if (NeedsKeyframe(*f, result)) {
      hint = map_->AddKeyframe(f);
      mapper_.Process(hint, map_.get());
      NoteFrame(*f, hint);
    } else {
      NoteFrame(*f, result.reference_keyframe);
    }
  }
  last_keyframe_ = k1;
  return true;
}

std::optional<Rigid3> Frontend::Predict(int64_t utime) const {
  if (!last_frame_ || !before_last_frame_) return std::nullopt;
  const double dt = static_cast<double>(last_frame_->utime - before_last_frame_->utime);
  const double ahead = static_cast<double>(utime - last_frame_->utime);
  if (dt <= 0 || ahead <= 0 || ahead > kMaxTimeRatio * dt) return std::nullopt;
  return Extrapolate(before_last_frame_->cam_from_submap, last_frame_->cam_from_submap, ahead / dt);
}

// A frame of the past, for which nothing that follows will tell whether its pose was right: its points must be spread
// wider and fix it better.
TrackResult Frontend::TrackAfterwards(const std::vector<int>& hints, Frame* frame) {
  TrackResult result = tracker_.Track(std::nullopt, hints, map_.get(), frame);
  if (result.success && (result.spread < options_.min_spread_afterwards ||
                         result.position_sigma > options_.max_position_sigma_afterwards)) {
    result.success = false;
    std::fill(frame->points.begin(), frame->points.end(), -1);
  }
  return result;
}

// Whether a frame that follows at the usual time lies implausibly far from the last one.
bool Frontend::IsJump(const Frame& frame) const {
  std::vector<double> depths;
  for (const int p : frame.points) {
    if (p >= 0) depths.push_back((frame.cam_from_submap * map_->Point(p).position).z());
  }
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  const Eigen::Vector3d last = last_frame_->cam_from_submap.Center();
  const double step = (frame.cam_from_submap.Center() - last).norm();
  const double last_step = (last - before_last_frame_->cam_from_submap.Center()).norm();
  return step > 5 * last_step && step > options_.max_jump * depths[depths.size() / 2];
}

FrameOutcome Frontend::TrackFrame(const FramePtr& frame) {
  FrameOutcome outcome;
  outcome.submap = map_->Id();
  std::vector<int> hints = {last_reference_};
  const auto add_hint = [&](int k) {
    if (k >= 0 && std::find(hints.begin(), hints.end(), k) == hints.end()) hints.push_back(k);
  };
  add_hint(last_keyframe_);
  add_hint(last_keyframe_ - 1);
  add_hint(last_keyframe_ - 2);
  const std::optional<Rigid3> prediction = lost_frames_ == 0 ? Predict(frame->utime) : std::nullopt;
  TrackResult result = tracker_.Track(prediction, hints, map_.get(), frame.get());
  if (result.success && prediction && IsJump(*frame) &&
      result.num_inliers < options_.jump_found_share * result.num_visible) {
    result.success = false;
    result.reason = LossReason::kInconsistentMotion;
    std::fill(frame->points.begin(), frame->points.end(), -1);
  }
  if (result.success) {
    outcome.state = FrontendState::kTracking;
    outcome.method = result.method;
    outcome.num_inliers = result.num_inliers;
    outcome.cam_from_submap = frame->cam_from_submap;
    before_last_frame_ = lost_frames_ == 0 ? last_frame_ : nullptr;
    last_frame_ = frame;
    last_reference_ = result.reference_keyframe;
    ++frames_since_start_;
    // Frames that failed before this one may be seen from here.
    std::reverse(lost_.begin(), lost_.end());
    for (const FramePtr& f : lost_) {
      const TrackResult again = TrackAfterwards({last_reference_, last_keyframe_}, f.get());
      if (again.success) NoteFrame(*f, again.reference_keyframe);
    }
    lost_.clear();
    lost_frames_ = 0;
    if (NeedsKeyframe(*frame, result)) {
      InsertKeyframe(frame);
      outcome.keyframe = true;
      outcome.cam_from_submap = frame->cam_from_submap;
    } else {
      NoteFrame(*frame, result.reference_keyframe);
      PublishWaitingFrames(frame->utime);
    }
    if (!confirmed_ && frames_since_start_ >= options_.confirm_frames) {
      WaitForMapping();
      confirmed_ = true;
      const auto by_frame = [](const TrackedFrame& a, const TrackedFrame& b) { return a.frame < b.frame; };
      outcome.submap_begin = std::min_element(tracked_frames_.begin(), tracked_frames_.end(), by_frame)->frame;
      initializer_.Clear();
      Publish(frame->utime);
    }
    return outcome;
  }

  outcome.state = FrontendState::kLost;
  outcome.reason = outcome.cause = ExplainFailure(*frame, result.reason);
  // The first frame tells best why tracking was lost: after a gap or a dark spell the next ones look well.
  if (lost_frames_ == 0) last_failure_ = outcome.reason;
  ++lost_frames_;
  lost_.push_back(frame);
  if (!confirmed_) {
    const LossReason cause = camera_.width < kSmallImage ? LossReason::kSmallImages : outcome.cause;
    AbandonSubmap();
    outcome = Initialise(frame);
    outcome.abandoned = cause;
    if (outcome.cause != LossReason::kNone) outcome.cause = cause;
    return outcome;
  }
  if (lost_frames_ == 1) initializer_.Clear();
  // A new submap is begun while the old one may still be found again: whichever succeeds first wins.
  const Initialization initialization = initializer_.AddFrame(frame);
  if (lost_frames_ < options_.max_lost_frames) return outcome;
  if (initialization.success || lost_frames_ >= options_.max_lost_frames + options_.relocalisation_frames) {
    CloseSubmap(last_failure_, std::to_string(lost_frames_) + " consecutive frames without orientation");
    Begin(initialization, &outcome);
  }
  return outcome;
}

// What is wrong with the image itself comes before what is wrong between images.
LossReason Frontend::InitialCause(const Frame& frame, const Initialization& initialization) const {
  if (frame.mean_brightness < kDark) return LossReason::kDarkness;
  if (camera_.width < kSmallImage) return LossReason::kSmallImages;
  if (static_cast<int>(frame.features.Size()) < options_.initializer.min_matches) return LossReason::kTooFewFeatures;
  if (frame.sharpness < kUnsharp) return LossReason::kBlur;
  return initialization.cause;
}

LossReason Frontend::ExplainFailure(const Frame& frame, LossReason tracker_reason) const {
  if (frame.mean_brightness < kDark) return LossReason::kDarkness;
  if (frame.sharpness < kBlurred * last_frame_->sharpness) return LossReason::kBlur;
  if (before_last_frame_ && static_cast<double>(frame.utime - last_frame_->utime) >
                                kGap * static_cast<double>(last_frame_->utime - before_last_frame_->utime)) {
    return LossReason::kInputGap;
  }
  return tracker_reason;
}

bool Frontend::NeedsKeyframe(const Frame& frame, const TrackResult& result) const {
  // A keyframe at hand may bring the points that are lacking: only one without which the submap might be lost joins it.
  const bool urgent = result.num_inliers < 2 * options_.tracker.min_inliers;
  if (mapping_ && mapping_->NumUnfinished() > 0 && !urgent) return false;
  const Frame& key = *map_->Keyframe(result.reference_keyframe).frame;
  // Points that only two keyframes saw are often not found again, through no fault of this frame's.
  const size_t solid_observations = map_->LastKeyframe() < 3 ? 2 : 3;
  const auto is_solid = [&](int p) { return p >= 0 && map_->Point(p).observations.size() >= solid_observations; };
  const auto solid = std::count_if(key.points.begin(), key.points.end(), is_solid);
  if (result.num_inliers < options_.keyframe_ratio * static_cast<double>(solid)) return true;
  if (result.num_inliers < options_.comfortable_inliers) return true;
  // Parallax, not motion of the image: a turn on the spot gives nothing to triangulate.
  const Eigen::Vector3d center = frame.cam_from_submap.Center(), key_center = key.cam_from_submap.Center();
  std::vector<double> cosines;
  for (const int p : frame.points) {
    if (p >= 0) cosines.push_back(CosIntersectionAngle(map_->Point(p).position, center, key_center));
  }
  std::nth_element(cosines.begin(), cosines.begin() + cosines.size() / 2, cosines.end());
  return cosines[cosines.size() / 2] < std::cos(options_.keyframe_angle_deg * M_PI / 180);
}

void Frontend::InsertKeyframe(const FramePtr& frame) {
  last_keyframe_ = map_->AddKeyframe(frame);
  last_reference_ = last_keyframe_;
  NoteFrame(*frame, last_keyframe_);
  if (mapping_) {
    mapping_->Push(last_keyframe_);
    WaitForMapping(static_cast<size_t>(options_.max_unmapped_keyframes));
    return;
  }
  const auto begin = std::chrono::steady_clock::now();
  mapper_.Process(last_keyframe_, map_.get());
  Publish(frame->utime);
  mapping_s_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// In the mapping thread.
void Frontend::MapKeyframe(int keyframe, MapLock* lock) {
  const StageTimer timer("map/keyframe");
  const int64_t utime = map_->Keyframe(keyframe).frame->utime;
  mapper_.Process(keyframe, map_.get(), lock);
  auto records = TakeRecords(utime, keyframe);
  lock->unlock();
  EmitRecords(std::move(records));
  lock->lock();
}

void Frontend::WaitForMapping(size_t unfinished_keyframes) {
  const StageTimer timer(mapping_ ? "track/map_backlog" : nullptr);
  if (mapping_) mapping_->WaitUntilLeft(unfinished_keyframes, &lock_);
}

void Frontend::NoteFrame(const Frame& frame, int reference_keyframe) {
  const WorkingKeyframe& reference = map_->Keyframe(reference_keyframe);
  tracked_frames_.push_back(
      {frame.index, frame.utime, reference.id, frame.cam_from_submap * reference.frame->cam_from_submap.Inverse()});
  ++num_tracked_;
}

void Frontend::AbandonSubmap() {
  WaitForMapping();
  num_tracked_ -= static_cast<int>(tracked_frames_.size());
  tracked_frames_.clear();
  ids_.next_submap = map_->Id().value;
  // The same pair of frames must not begin the same mistake again.
  const FramePtr first = map_->Keyframe(0).frame;
  map_.reset();
  std::deque<FramePtr> frames = initializer_.Frames();
  const auto at = std::find(frames.begin(), frames.end(), first);
  if (at != frames.end() && at + 1 != frames.end()) initializer_.DropBefore(*(at + 1));
  last_frame_ = before_last_frame_ = nullptr;
  lost_frames_ = 0;
  lost_.clear();
}

void Frontend::CloseSubmap(LossReason reason, const std::string& detail) {
  WaitForMapping();
  const int64_t utime = last_frame_->utime;
  Publish(utime);
  emit_(utime, SubmapEnded{map_->Id(), ToString(reason), detail, last_frame_->index, utime});
  ++num_losses_;
  map_.reset();
  last_frame_ = before_last_frame_ = nullptr;
  lost_frames_ = 0;
  lost_.clear();
}

std::vector<std::pair<int64_t, RecordBody>> Frontend::TakeRecords(int64_t utime, int last_keyframe) {
  std::vector<std::pair<int64_t, RecordBody>> records;
  if (!confirmed_) return records;
  if (first_unpublished_keyframe_ == 0) records.emplace_back(map_->Keyframe(0).frame->utime, SubmapStarted{map_->Id()});
  for (; first_unpublished_keyframe_ <= last_keyframe; ++first_unpublished_keyframe_) {
    const int k = first_unpublished_keyframe_;
    const WorkingKeyframe& keyframe = map_->Keyframe(k);
    KeyframeRecord record;
    record.submap = map_->Id();
    record.keyframe = keyframe.id;
    record.frame = keyframe.frame->index;
    record.cam_from_submap = keyframe.frame->cam_from_submap;
    record.features = keyframe.frame->features;
    record.map_points = map_->PublishedPoints(k);
    map_->MarkPublished(k);
    records.emplace_back(keyframe.frame->utime, std::move(record));
  }
  MapUpdate update = map_->TakeUpdate();
  // Frames that refer to a keyframe that is not in the map yet follow with it.
  const KeyframeId last_published = map_->Keyframe(first_unpublished_keyframe_ - 1).id;
  const auto later = std::stable_partition(tracked_frames_.begin(), tracked_frames_.end(),
                                           [&](const TrackedFrame& f) { return !(last_published < f.keyframe); });
  update.frames.assign(tracked_frames_.begin(), later);
  tracked_frames_.erase(tracked_frames_.begin(), later);
  if (!update.keyframes.empty() || !update.points.empty() || !update.observations.empty() ||
      !update.removed_keyframes.empty() || !update.removed_points.empty() || !update.frames.empty()) {
    records.emplace_back(utime, std::move(update));
  }
  return records;
}

void Frontend::EmitRecords(std::vector<std::pair<int64_t, RecordBody>> records) {
  const StageTimer timer("map/publish");
  for (auto& [utime, body] : records) {
    if (auto* keyframe = std::get_if<KeyframeRecord>(&body)) {
      if (vocabulary_ != nullptr) {
        BowTransform transform = vocabulary_->Transform(keyframe->features);
        keyframe->words = std::move(transform.words);
        keyframe->nodes = std::move(transform.nodes);
        keyframe->bow = std::move(transform.bow);
      } else {
        keyframe->words.assign(keyframe->features.Size(), -1);
        keyframe->nodes.assign(keyframe->features.Size(), -1);
      }
    }
    emit_(utime, std::move(body));
  }
}

void Frontend::Publish(int64_t utime) { EmitRecords(TakeRecords(utime, map_->LastKeyframe())); }

// Without what else has changed: that goes with the next keyframe.
void Frontend::PublishWaitingFrames(int64_t utime) {
  if (!confirmed_ || first_unpublished_keyframe_ == 0 || tracked_frames_.empty()) return;
  const bool has_many = static_cast<int>(tracked_frames_.size()) >= options_.max_waiting_frames;
  const bool has_old =
      mapping_ && static_cast<double>(utime - tracked_frames_.front().utime) >= 1e6 * options_.max_waiting_s;
  // A keyframe at hand publishes them anyway, and records must not be emitted by two threads at a time.
  if ((!has_many && !has_old) || (mapping_ && mapping_->NumUnfinished() > 0)) return;
  MapUpdate update;
  update.submap = map_->Id();
  update.frames = std::exchange(tracked_frames_, {});
  emit_(utime, std::move(update));
}

void Frontend::Finish() {
  const Locked locked(&lock_);
  if (!map_) return;
  if (!confirmed_) {
    AbandonSubmap();
    return;
  }
  const int losses = num_losses_;
  CloseSubmap(LossReason::kEndOfInput, "the input ended");
  num_losses_ = losses;
}

}  // namespace mapmend

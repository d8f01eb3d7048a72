#include "procs/frontend/sparse_photos.h"

#include <algorithm>

#include "libs/base/median.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr size_t kMaxConverted = 4;  // one is at hand, others are asked for once more when a beginning fails
constexpr size_t kNumIntervals = 5;  // that tell how images come

}  // namespace

void SparsePhotos::OnFrame(const FramePtr& photo) {
  utimes_.push_back(photo->utime);
  if (utimes_.size() > kNumIntervals + 1) utimes_.pop_front();
}

bool SparsePhotos::ComeAtIntervals() const {
  std::vector<double> intervals;  // s
  for (size_t i = 1; i < utimes_.size(); ++i)
    intervals.push_back(1e-6 * static_cast<double>(utimes_[i] - utimes_[i - 1]));
  return !intervals.empty() && Median(std::move(intervals)) >= options_.min_interval_s;
}

FramePtr SparsePhotos::Converted(const FramePtr& photo) {
  const auto known =
      std::find_if(converted_.begin(), converted_.end(), [&](const FramePtr& f) { return f->photo == photo; });
  if (known != converted_.end()) return *known;
  const StageTimer timer("track/wide_features");
  converted_.push_back(convert_(photo));
  if (converted_.size() > kMaxConverted) converted_.pop_front();
  return converted_.back();
}

FramePtr SparsePhotos::ConvertLeftover(const FramePtr& photo) {
  FramePtr frame = Converted(photo);
  leftovers_.Add(frame);
  return frame;
}

Initialization SparsePhotos::AddFrame(const FramePtr& photo) {
  Initialization none;
  none.reason = LossReason::kTooFewMatches;
  if (!convert_) return none;
  if (!ComeAtIntervals()) {
    waiting_ = {photo};
    return none;
  }
  for (const FramePtr& before : waiting_) {
    if (before->image) beginning_.Keep(ConvertLeftover(before));
  }
  waiting_.clear();
  return beginning_.AddFrame(ConvertLeftover(photo));
}

TrackResult SparsePhotos::Track(const Tracker& tracker, const std::vector<KeyframeIndex>& hints, const FramePtr& frame,
                                WorkingMap* map) const {
  TrackResult result = tracker.TrackAfterwards(hints, *frame, map);
  return result.success ? result : extension_.Track(hints, frame, *map);
}

void SparsePhotos::Keep(const FramePtr& frame) {
  if (!convert_) return;
  if (frame->photo) {
    beginning_.Keep(frame);
  } else {
    if (!ComeAtIntervals()) waiting_.clear();
    waiting_.push_back(frame);
  }
}

void SparsePhotos::ClearBeginning() {
  beginning_.Clear();
  waiting_.clear();
}

void SparsePhotos::OnBegin(const WorkingMap& map) {
  for (const WorkingKeyframe& keyframe : map.Keyframes()) OnPose(keyframe.frame);
}

void SparsePhotos::NoteMistake(const WorkingMap& map) {
  beginning_.NoteMistake(map.Keyframes()[0].frame, map.Keyframes()[1].frame);
  for (const WorkingKeyframe& keyframe : map.Keyframes()) leftovers_.Add(keyframe.frame);
}

}  // namespace mapmend

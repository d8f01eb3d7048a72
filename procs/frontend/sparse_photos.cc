#include "procs/frontend/sparse_photos.h"

#include <algorithm>
#include <numeric>

#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr size_t kMaxConverted = 4;  // one is at hand, others are asked for once more when a beginning fails

// Two photos of the same ground have so many of their strongest features in common.
constexpr int kNumStrongest = 1000;
constexpr int kMinAlike = 12;

std::vector<int> Strongest(const Frame& frame) {
  std::vector<int> indices(std::min(kNumStrongest, frame.features.Size()));
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

}  // namespace

void SparsePhotos::OnFrame(const FramePtr& photo) {
  come_ = has_last_ && static_cast<double>(photo->utime - last_utime_) >= 1e6 * options_.min_interval_s;
  last_utime_ = photo->utime;
  has_last_ = true;
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

void SparsePhotos::LeaveOver(const FramePtr& frame) {
  if (std::find(leftovers_.begin(), leftovers_.end(), frame) == leftovers_.end()) leftovers_.push_back(frame);
  while (leftovers_.size() > static_cast<size_t>(options_.max_leftovers)) leftovers_.pop_front();
}

void SparsePhotos::OnPose(const FramePtr& frame) {
  std::erase(leftovers_, frame);
}

std::vector<FramePtr> SparsePhotos::Alike(const FramePtr& frame) const {
  const std::vector<int> strongest_here = Strongest(*frame);
  std::vector<std::pair<int, FramePtr>> found;
  for (const FramePtr& f : leftovers_) {
    if (f == frame) continue;
    const auto matches = MatchBruteForce(frame->features, f->features, {}, strongest_here, Strongest(*f));
    if (static_cast<int>(matches.size()) >= kMinAlike) found.emplace_back(static_cast<int>(matches.size()), f);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<FramePtr> alike;
  for (size_t i = 0; i < std::min(found.size(), static_cast<size_t>(options_.max_recovered)); ++i)
    alike.push_back(found[i].second);
  return alike;
}

}  // namespace mapmend

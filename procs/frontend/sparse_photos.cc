#include "procs/frontend/sparse_photos.h"

#include <algorithm>

#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr size_t kMaxConverted = 4;  // one is at hand, others are asked for once more when a beginning fails

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

}  // namespace mapmend

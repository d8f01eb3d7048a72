#pragma once

#include <deque>
#include <vector>

#include "libs/base/range.h"
#include "procs/frontend/frame.h"

namespace mapmend {

struct LeftoverPhotosOptions {
  int max_kept = 100;    // photos, half a megabyte each; the oldest are forgotten
  int max_alike = 3;     // of them, that are looked for with a new keyframe
  int min_matches = 12;  // of the strongest features, that two photos of the same ground have at least

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_kept", max_kept, Range(0, 100000), "photos");
    v("max_alike", max_alike, Range(0, 10000), "photos");
    v("min_matches", min_matches, Range(1, 100000));
  }
};

// Photos that found no place when they came. On a survey the next strip sees the same ground from beside, and often has
// more in common with such a photo than its neighbours in time have.
class LeftoverPhotos {
 public:
  explicit LeftoverPhotos(const LeftoverPhotosOptions& options) : options_(options) {}

  void Add(const FramePtr& frame);
  void Remove(const FramePtr& frame) {
    std::erase_if(frames_, [&](const FramePtr& f) { return f->photo == frame->photo; });
  }
  // Those that look like this one, most alike first.
  std::vector<FramePtr> Alike(const Frame& frame) const;

 private:
  LeftoverPhotosOptions options_;
  std::deque<FramePtr> frames_;
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/wide_features.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/photo_pair.h"

namespace mapmend {

struct SparsePhotosOptions {
  double min_interval_s = 0.4;  // between two images: less, and it is a video; there is no time for wide features
  int confirm_frames = 1;       // photos that must be tracked in a new submap before it is believed
  int max_keyframes = 30;       // of the submap, newest first, that a photo is matched with
  int max_leftovers = 100;      // photos without a pose that are kept for submaps that come later, half a megabyte each
  int max_recovered = 3;        // of them, that are looked for with a new photo
  WideExtractionOptions extraction = {.max_features = 8000, .contrast_threshold = 0.01};
  PhotoPairOptions pairs;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_interval_s", min_interval_s, AtLeast(0), "s");
    v("confirm_frames", confirm_frames, Range(0, 10000), "frames");
    v("max_keyframes", max_keyframes, Range(1, 10000), "keyframes");
    v("max_leftovers", max_leftovers, Range(0, 100000), "photos");
    v("max_recovered", max_recovered, Range(0, 10000), "photos");
    v("extraction", extraction);
    v("pairs", pairs);
  }
};

// Photos of a survey that overlap by 60 to 75 %: from one to the next hardly a feature of ORB's is left, while wide
// ones still hold. Where ORB finds no beginning in images that come at intervals, the same images with wide features
// are tried, and a submap that began with them goes on with them. Does nothing before Enable.
class SparsePhotos {
 public:
  using Convert = std::function<FramePtr(const FramePtr& photo)>;

  explicit SparsePhotos(const SparsePhotosOptions& options) : options_(options) {}

  // convert gives the same image with wide features.
  void Enable(Convert convert) { convert_ = std::move(convert); }
  // Every image, in order.
  void OnFrame(const FramePtr& photo);
  // Whether images come as photos, and may be converted.
  bool Come() const { return convert_ && come_; }
  // The newest ones are kept.
  FramePtr Converted(const FramePtr& photo);
  // A converted photo has no pose; it has one now.
  void LeaveOver(const FramePtr& frame);
  void OnPose(const FramePtr& frame);
  // Photos without a pose that look like this one, most alike first.
  std::vector<FramePtr> Alike(const FramePtr& frame) const;

 private:
  SparsePhotosOptions options_;
  Convert convert_;
  int64_t last_utime_ = 0;
  bool has_last_ = false, come_ = false;
  std::deque<FramePtr> converted_, leftovers_;
};

}  // namespace mapmend

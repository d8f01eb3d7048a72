#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/wide_features.h"
#include "procs/frontend/leftover_photos.h"
#include "procs/frontend/pair_extension.h"
#include "procs/frontend/sparse_beginning.h"

namespace mapmend {

struct SparsePhotosOptions {
  double min_interval_s = 1;  // between images, median: less, and it is a video; there is no time for wide features
  int confirm_frames = 1;     // photos that must be tracked in a new submap before it is believed, beside the first two
  int max_keyframes = 30;     // of the submap, newest first, that a photo is matched with
  double max_speed = 4;  // of the usual one, from a photo to those before and after it: faster, and it is elsewhere
  WideExtractionOptions extraction = {.max_features = 8000, .contrast_threshold = 0.01};
  PhotoPairOptions pairs;
  LeftoverPhotosOptions leftovers;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_interval_s", min_interval_s, AtLeast(0), "s");
    v("confirm_frames", confirm_frames, Range(0, 10000), "frames");
    v("max_keyframes", max_keyframes, Range(1, 10000), "keyframes");
    v("max_speed", max_speed, MoreThan(0), "of the usual one");
    v("extraction", extraction);
    v("pairs", pairs);
    v("leftovers", leftovers);
  }
};

// Photos of a survey that overlap by 60 to 75 %: from one to the next hardly a feature of ORB's is left, while wide
// ones still hold. Where ORB finds no beginning in images that come at intervals, the same images with wide features
// are tried, and a submap that began with them goes on with them: a sparse one. Does nothing before Enable.
class SparsePhotos {
 public:
  using Convert = std::function<FramePtr(const FramePtr& photo)>;

  SparsePhotos(const SparsePhotosOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options),
        beginning_(options.pairs, camera, pyramid),
        extension_(options.pairs, camera, pyramid),
        leftovers_(options.leftovers) {}

  // convert gives the same image with wide features.
  void Enable(Convert convert) { convert_ = std::move(convert); }
  // Every image, in order, before anything else is done with it.
  void OnFrame(const FramePtr& photo);
  // The newest ones are kept.
  FramePtr Converted(const FramePtr& photo);

  // A photo without a pose. With success: a beginning, to which it belongs as well.
  Initialization AddFrame(const FramePtr& photo);
  // A frame that was tracked in a submap that is not believed yet.
  void Keep(const FramePtr& frame);
  void ClearBeginning();
  // Photos since the loss, oldest first.
  const std::deque<FramePtr>& Frames() const { return beginning_.Frames(); }
  // A sparse submap has begun; it was a mistake; it is believed.
  void OnBegin(const WorkingMap& map);
  void NoteMistake(const WorkingMap& map);
  void OnBelieved() { have_taken_over_ = true; }
  // There is a sparse submap that is believed: no others are begun any more.
  bool HaveTakenOver() const { return have_taken_over_; }

  // The pose of a photo in a sparse submap, by its points or else by its pair with a keyframe. A photo is not believed
  // more easily than a frame of the past: none that follows soon would tell that it was wrong; and the motion since the
  // last one predicts nothing where features are so dense.
  TrackResult Track(const Tracker& tracker, const std::vector<KeyframeIndex>& hints, const FramePtr& frame,
                    WorkingMap* map) const;
  void OnPose(const FramePtr& frame) { leftovers_.Remove(frame); }
  // Photos without a pose that look like this frame, most alike first.
  std::vector<FramePtr> Leftovers(const Frame& frame) const { return leftovers_.Alike(frame); }

 private:
  bool ComeAtIntervals() const;
  FramePtr ConvertLeftover(const FramePtr& photo);

  SparsePhotosOptions options_;
  SparseBeginning beginning_;
  PairExtension extension_;
  LeftoverPhotos leftovers_;
  Convert convert_;
  std::deque<int64_t> utimes_;  // of the newest images
  std::deque<FramePtr> converted_;
  std::vector<FramePtr> waiting_;  // since the loss, that are converted if the next one finds no beginning either
  bool have_taken_over_ = false;
};

// Whether the submap is one of photos with wide features.
inline bool IsSparse(const WorkingMap& map) { return map.Keyframes().front().frame->photo != nullptr; }

}  // namespace mapmend

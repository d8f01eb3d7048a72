#pragma once

#include <deque>

#include "procs/frontend/initializer.h"
#include "procs/frontend/photo_pair.h"

namespace mapmend {

// A submap begins with three photos: of the motions that are possible between the first two and between the last two,
// those that give the points which all three see the same depths. Photos since the loss are kept.
class SparseBeginning {
 public:
  SparseBeginning(const PhotoPairOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // With success: of two photos that were kept; this one is the third.
  Initialization AddFrame(const FramePtr& frame);
  // Keeps a photo without trying it.
  void Keep(const FramePtr& frame);
  // A submap that began with these two was a mistake.
  void NoteMistake(const FramePtr& first, const FramePtr& second);
  void Clear();
  // Oldest first.
  const std::deque<FramePtr>& Frames() const { return frames_; }

 private:
  PhotoPairOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  std::deque<FramePtr> frames_;
  std::deque<PhotoPair> pairs_;  // that have a motion, of the newest photos
};

}  // namespace mapmend

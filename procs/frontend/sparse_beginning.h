#pragma once

#include <deque>
#include <vector>

#include "procs/frontend/initializer.h"
#include "procs/frontend/photo_pair.h"

namespace mapmend {

// A beginning of three photos: of the motions that are possible between the first two and between the last two, those
// that give the points which all three see the same depths. Frames since the loss are kept.
class SparseBeginning {
 public:
  SparseBeginning(const PhotoPairOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // With success: of two frames that were kept, to which this one goes.
  Initialization AddFrame(const FramePtr& frame);
  // Keeps a frame without trying it.
  void Keep(const FramePtr& frame);
  // A submap that began with these two was a mistake.
  void NoteMistake(const FramePtr& first, const FramePtr& second);
  void Clear();
  // Oldest first.
  const std::deque<FramePtr>& Frames() const { return frames_; }

 private:
  struct Choice {
    const TwoViewCandidate* motion = nullptr;
    int num_agreeing = 0;
    int num_rival = 0;  // points that agree with another one
  };
  Choice Decide(const PhotoPair& earlier, const PhotoPair& later) const;
  void AddPairs(const FramePtr& frame);

  PhotoPairOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  std::deque<FramePtr> frames_;
  std::deque<PhotoPair> pairs_;
};

}  // namespace mapmend

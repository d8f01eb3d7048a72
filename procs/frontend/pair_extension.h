#pragma once

#include <vector>

#include "procs/frontend/photo_pair.h"
#include "procs/frontend/tracker.h"

namespace mapmend {

// A photo that shows too few points of the map for a pose: where photos overlap by 60 %, only a fifth of an image is
// seen in three of them. But it has much in common with the last one: their relative motion comes from everything that
// the two share, and the few points that the map knows already tell the scale, and which motion is true.
class PairExtension {
 public:
  PairExtension(const PhotoPairOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // With success, the result tells the points of the map that the frame shows, and new ones; the reason of a failure is
  // too_few_matches. hints: keyframes to begin with.
  TrackResult Track(const std::vector<KeyframeIndex>& hints, const FramePtr& frame, const WorkingMap& map) const;

 private:
  TrackResult FromPair(KeyframeIndex keyframe, const PhotoPair& pair, const WorkingMap& map) const;

  PhotoPairOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
};

}  // namespace mapmend

#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/local_window.h"

namespace mapmend {

using KeyframeWindow = std::vector<const SubmapKeyframe*>;

// Two map points that look alike, one of each of two submaps.
struct PooledMatch {
  MapPointId point_a, point_b;
  int votes = 0;                                                      // pairs of keyframes that matched them
  int distance = 256;                                                 // of their nearest descriptors ...
  const SubmapKeyframe *keyframe_a = nullptr, *keyframe_b = nullptr;  // ... and where these were seen
  int feature_a = -1, feature_b = -1;
  double log_scale = 0;  // logarithm of the scale of b_from_a that makes the two patches equally large
  double turn = 0;       // radians from the image of a's first keyframe to that of b's, about the optical axis
};

struct WindowMatchingOptions {
  int max_distance = 64;       // bits
  double ratio = 0.85;         // best against second best
  double scale_octaves = 1.5;  // half the width, in pyramid levels, of what counts as one scale
  double turn_deg = 18;        // and as one turn

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_distance", max_distance, Range(0, 256), "bits");
    v("ratio", ratio, Range(0, 1));
    v("scale_octaves", scale_octaves, MoreThan(0), "octaves");
    v("turn_deg", turn_deg, Range(0, 180), "degrees");
  }
};

// Map points of two windows that look alike: those that the first keyframe of either window sees with those of all of
// the other, by vocabulary node, each point at most once. a and b may be the same submap: a point does not match
// itself.
std::vector<PooledMatch> MatchWindows(const SubmapView& a, const KeyframeWindow& window_a, const SubmapView& b,
                                      const KeyframeWindow& window_b, const WindowMatchingOptions& options);

// The set of matches that agree best on the relative scale and on the turn of the images (after Lowe, IJCV 2004,
// section 7), taken out of *matches, in their order. A patch has a size in units of its submap, octave times depth, so
// one scale fits all true matches, however far the one camera stood and however much deeper the one image looks; chance
// spreads over all scales and turns. Matches count by how near their descriptors are and how often they were found:
// near the scale at which both images show equally much there are many by chance.
std::vector<PooledMatch> TakeAgreeing(const WindowMatchingOptions& options, double pyramid_factor,
                                      std::vector<PooledMatch>* matches);

}  // namespace mapmend

#pragma once

#include "libs/base/range.h"
#include "libs/connecting/connection.h"

namespace mapmend {

struct RecognizedShareOptions {
  double min_overlap =
      0.4;  // of the map points of either keyframe, inside the other's image: then the two should be connected
  double max_zoom = 2;       // either way, and
  double max_view_deg = 45;  // between the optical axes: beyond, the same ground need not look the same
  int max_keyframes = 60;    // of each submap that are asked, evenly chosen
  int num_samples = 20;      // map points per keyframe that stand for all
  int doubt = 2;             // keyframes: so few predictions say little

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_overlap", min_overlap, Range(0, 1), "of the points");
    v("max_zoom", max_zoom, AtLeast(1));
    v("max_view_deg", max_view_deg, Range(0, 180), "degrees");
    v("max_keyframes", max_keyframes, Range(1, 1e6), "keyframes");
    v("num_samples", num_samples, Range(1, 1e6), "points");
    v("doubt", doubt, Range(0, 1e6), "keyframes");
  }
};

// What speaks against a connection is what it predicts and nobody saw. If the transform is right, keyframes that it
// lays over each other show the same ground, and most of them are connected frames. Where only a patch of the ground
// looks alike, those beyond the patch are not. Returns (found + doubt) / (predicted + doubt), counting keyframes of b,
// the younger submap, all of which have asked for connected frames in a: those that the transform lays over one of a,
// and of them those that take part in evidence that agrees. 1 if there is so much evidence that no more was looked for.
double RecognizedShare(const SubmapView& a, const SubmapView& b, const Connection& connection, int max_evidence,
                       const RecognizedShareOptions& options);

}  // namespace mapmend

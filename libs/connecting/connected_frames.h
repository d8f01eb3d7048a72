#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/window_matching.h"
#include "libs/geometry/sim3_ransac.h"
#include "libs/geometry/sim3_refinement.h"

// Connected frames (paper §3.3): two keyframes of different submaps, or of far-apart parts of one, that see the same
// ground. Retrieval proposes a pair; here geometry decides.
namespace mapmend {

// A map point of one side is feature `feature` of keyframe `keyframe` of the other side. Where that lies is kept beside
// it: the features of a keyframe are not held for ever.
struct CrossMatch {
  MapPointId point;
  KeyframeId keyframe;
  int feature : 24 = -1;
  int octave : 8 = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
};

struct ConnectedFramesOptions {
  // Keyframes around each of the two that lend their map points and features, so that a small overlap suffices.
  int window_size = 6;
  int max_window_size = 24;  // on the side that stands nearer to the ground than the other
  WindowMatchingOptions matching;
  int min_matches = 5;     // that agree in scale and turn; below it no Sim(3) is tried
  int num_hypotheses = 3;  // about scale and turn that are tried, best first
  Sim3RansacOptions ransac;
  // Guided matching with the transform found, both ways.
  double search_radius = 12;  // pixels at octave 0 in the first round, half of it in the second ...
  int min_good_seeds = 12;    // ... and twice as much in one before them, if fewer points agreed so far
  int guided_max_distance = 64;
  double guided_ratio = 0.9;
  int num_searched = 3;      // keyframes of each window that are searched
  int octave_tolerance = 2;  // levels about the predicted one
  double max_turn_deg = 30;  // keypoint orientation against the predicted one
  Sim3RefinementOptions refinement;
  // Acceptance.
  int min_inliers = 30;  // reprojections within 99 %, both ways together
  int min_inliers_each_way = 8;
  int min_common_points = 6;  // inliers whose feature observes a map point of its own submap
  // Inliers among the map points that the transform predicts to be seen in the other keyframe. Things of one make,
  // doors or lamps, match as well as one and the same, but what stands around them does not: wrong transforms reach 7
  // %.
  double min_match_rate = 0.10;
  int min_cells = 5;  // of an 8 x 6 grid, occupied by inliers, in each of the two images ...
  int min_cells_of_zoomed =
      3;  // ... but fewer if one looks from more than twice as far: 2 min_cells / ratio, at least so many
  double max_median_error = 3;  // pixels
  double max_scale = 8;         // of the transform, either way
  int max_kept = 100;           // inliers each way that are kept as evidence, evenly chosen

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("window_size", window_size, Range(1, 1000), "keyframes");
    v("max_window_size", max_window_size, Range(1, 1000), "keyframes");
    v("matching", matching);
    v("min_matches", min_matches, Range(3, 100000));
    v("num_hypotheses", num_hypotheses, Range(1, 1000));
    v("ransac", ransac);
    v("search_radius", search_radius, MoreThan(0), "pixels at octave 0");
    v("min_good_seeds", min_good_seeds, Range(0, 100000));
    v("guided_max_distance", guided_max_distance, Range(0, 256), "bits");
    v("guided_ratio", guided_ratio, Range(0, 1));
    v("num_searched", num_searched, Range(1, 1000), "keyframes");
    v("octave_tolerance", octave_tolerance, Range(0, 31), "octaves");
    v("max_turn_deg", max_turn_deg, Range(0, 180), "degrees");
    v("refinement", refinement);
    v("min_inliers", min_inliers, Range(0, 100000));
    v("min_inliers_each_way", min_inliers_each_way, Range(0, 100000));
    v("min_common_points", min_common_points, Range(0, 100000));
    v("min_match_rate", min_match_rate, Range(0, 1));
    v("min_cells", min_cells, Range(0, 48), "cells of 48");
    v("min_cells_of_zoomed", min_cells_of_zoomed, Range(0, 48), "cells of 48");
    v("max_median_error", max_median_error, MoreThan(0), "pixels");
    v("max_scale", max_scale, AtLeast(1));
    v("max_kept", max_kept, Range(1, 100000));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Keyframes in the windows of the two sides.
struct WindowSizes {
  int a = 0, b = 0;
};

// What wide features have found across a gap: shared by all pairs of frames that say so.
struct WideCommonPoints {
  // Where a keyframe of one of the two submaps sees a point, in the ideal camera.
  struct Sighting {
    bool is_in_b = false;
    KeyframeId keyframe;
    Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
    float sigma = 1;  // pixels
  };
  std::vector<Eigen::Vector3d> in_a;             // that both submaps see, frame of a
  std::vector<std::vector<Sighting>> sightings;  // of each, by keyframes that were not culled
};

struct ConnectedFrames {
  bool success = false;
  std::string reason;  // one sentence with numbers, for a person
  KeyframeId keyframe_a, keyframe_b;
  Similarity3 b_from_a;  // between the submap frames
  Matrix7d information = Matrix7d::Zero();
  int num_matches = 0;  // of descriptors
  int num_ransac_inliers = 0;
  int num_inliers = 0;  // reprojections both ways
  double match_rate = 0;
  double median_error_px = 0;
  double median_angle_rad = 0;  // between the rays of the two keyframes to the common points
  WindowSizes wanted;           // what the difference in viewing distance calls for; zeros if no transform was found
  std::vector<CrossMatch> a_in_b, b_in_a;                        // inliers, thinned to max_kept
  std::vector<std::pair<MapPointId, MapPointId>> common_points;  // (a's, b's), ascending, each point at most once
  // Connected by wide features, not by map points: then there are no matches and no pairs of map points. Null: by ORB.
  std::shared_ptr<const WideCommonPoints> wide;
  // Connected by how the camera moved across a gap (motion_bridge.h): there is nothing that both have seen.
  bool by_motion = false;
};

// Verifies one proposed pair. a and b may view the same submap (loop closure): then points in common beforehand do not
// count. The windows are of options.window_size or sizes, whichever is larger. Deterministic for equal input and
// options.ransac.seed.
ConnectedFrames VerifyConnectedFrames(const SubmapView& a, KeyframeId keyframe_a, const SubmapView& b,
                                      KeyframeId keyframe_b, const ConnectedFramesOptions& options,
                                      const WindowSizes& sizes = {});

// Matches as geometry, from the submaps as they are now; those whose point or keyframe was culled meanwhile are left
// out.
CrossObservations ResolveMatches(const SubmapView& a, const SubmapView& b, const std::vector<CrossMatch>& a_in_b,
                                 const std::vector<CrossMatch>& b_in_a);

// Median error (pixels) of observations under a transform that need not have been estimated from them; infinite without
// any.
double MedianErrorPx(const CrossObservations& observations, const Similarity3& b_from_a);

// Median angle (radians) at common points between the rays from two camera centres, all in the frame of b.
double MedianIntersectionAngle(const Eigen::Vector3d& center_a, const Eigen::Vector3d& center_b,
                               const std::vector<Eigen::Vector3d>& points);

}  // namespace mapmend

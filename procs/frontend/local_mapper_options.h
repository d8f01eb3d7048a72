#pragma once

#include "libs/base/range.h"
#include "libs/geometry/chi_square.h"
#include "libs/optim/pose_optimization.h"

namespace mapmend {

struct LocalMapperOptions {
  int num_neighbours = 10;     // keyframes to triangulate and fuse with
  int min_covisible = 15;      // shared points of a neighbour
  double min_angle_deg = 1.0;  // between the rays of a new point
  int max_distance = 60;       // bits
  double ratio = 0.85;
  double fuse_radius_px = 3;
  int max_overlapping_keyframes = 6;  // searched by place, though they share no points yet (strips side by side)
  double overlap_radius = 0.02;       // search radius there, of the image width
  int bundle_keyframes = 12;          // optimised by local bundle adjustment
  int bundle_fixed_keyframes = 20;    // that hold it in place
  int bundle_iterations = 5;
  int bundle_points = 150;                 // that determine a keyframe's pose there; the other points follow
  double outlier_chi2 = kChiSquare2Dof95;  // of a point in one image, sigma^2
  double redundant_share = 0.9;     // of a keyframe's points that enough others see as well as it does: it is culled
  int redundant_observers = 3;      // keyframes that see a point at the same octave, give or take one, or a finer one
  int num_expanded = 5;             // neighbours, best first, whose own neighbours are fused with as well
  int expanded_neighbours = 5;      // of each of them
  int expanded_min_covisible = 30;  // points that those share with it: twice as many as a neighbour needs
  // Of a new point, while the keyframe that gave it is so young:
  int probation_keyframes = 3;
  double min_found_share = 0.25;  // of the frames that should have seen it: found in fewer, it is wrong
  int min_observations = 3;       // at the end: what only its own two keyframes see was hardly ever matched right
  // New points are looked for between these depths. A twentieth of the known points on either side may lie anywhere.
  int min_depths = 10;           // known points that tell depths; fewer: no new points
  double nearest_depth = 0.5;    // of the near ones
  double farthest_depth = 2.5;   // of the far ones
  double min_baseline = 0.01;    // of the median depth; neighbours that are closer give no depth
  double max_search_length = 2;  // of the epipolar line, in image widths; along longer ones nothing is looked for
  double scale_slack = 1.8;      // ratio of distances against ratio of patch sizes, either way: one and a half levels
  double min_view_cos = 0.5;     // a point seen from more than 60 degrees off its usual direction looks different
  int octave_tolerance = 1;      // about the one that the distance predicts
  double fuse_chi2_factor = 2;   // of outlier_chi2: either of the two points that are to be one has its own error
  // A keyframe that overlaps this one, near enough in distance and direction to be matched:
  double overlap_min_depth = 0.3, overlap_max_depth = 3;  // where this one's centre lies before it, of the median depth
  double overlap_min_axis_cos = 0.7;                      // between the optical axes: 45 degrees
  double overlap_max_offset = 0.6;      // from its image's centre to where this one's centre is seen, in image widths
  int overlap_min_points = 30;          // that are not shared yet
  double overlap_ratio = 0.8;           // of a match in that wide window
  int overlap_min_agreeing = 25;        // matches that agree on one small correction ...
  double overlap_agreeing_share = 0.4;  // ... and their share of all: strips of alike fields match by chance
  int final_iterations = 20;            // of the adjustment of all keyframes, at the beginning of a submap
  PoseOptimizationOptions pose;         // of that correction

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("num_neighbours", num_neighbours, Range(1, 10000), "keyframes");
    v("min_covisible", min_covisible, Range(1, 100000), "points");
    v("min_angle_deg", min_angle_deg, Range(0, 90), "degrees");
    v("max_distance", max_distance, Range(0, 256), "bits");
    v("ratio", ratio, Range(0, 1));
    v("fuse_radius_px", fuse_radius_px, MoreThan(0), "pixels at octave 0");
    v("max_overlapping_keyframes", max_overlapping_keyframes, Range(0, 10000), "keyframes");
    v("overlap_radius", overlap_radius, Range(0, 1), "of the image width");
    v("bundle_keyframes", bundle_keyframes, Range(1, 10000), "keyframes");
    v("bundle_fixed_keyframes", bundle_fixed_keyframes, Range(0, 10000), "keyframes");
    v("bundle_iterations", bundle_iterations, Range(1, 10000));
    v("bundle_points", bundle_points, Range(0, 1e6), "points; 0: all");
    v("outlier_chi2", outlier_chi2, MoreThan(0), "sigma^2");
    v("redundant_share", redundant_share, Range(0, 1), "of the points");
    v("redundant_observers", redundant_observers, Range(1, 10000), "keyframes");
    v("num_expanded", num_expanded, Range(0, 10000), "keyframes");
    v("expanded_neighbours", expanded_neighbours, Range(0, 10000), "keyframes");
    v("expanded_min_covisible", expanded_min_covisible, Range(1, 100000), "points");
    v("probation_keyframes", probation_keyframes, Range(0, 10000), "keyframes");
    v("min_found_share", min_found_share, Range(0, 1), "of the frames");
    v("min_observations", min_observations, Range(2, 10000), "keyframes");
    v("min_depths", min_depths, Range(1, 100000), "points");
    v("nearest_depth", nearest_depth, Range(0, 1), "of the 5 % nearest");
    v("farthest_depth", farthest_depth, AtLeast(1), "of the 5 % farthest");
    v("min_baseline", min_baseline, AtLeast(0), "of the median depth");
    v("max_search_length", max_search_length, MoreThan(0), "image widths");
    v("scale_slack", scale_slack, AtLeast(1));
    v("min_view_cos", min_view_cos, Range(-1, 1), "cosine");
    v("octave_tolerance", octave_tolerance, Range(0, 31), "octaves");
    v("fuse_chi2_factor", fuse_chi2_factor, MoreThan(0));
    v("overlap_min_depth", overlap_min_depth, AtLeast(0), "of the median depth");
    v("overlap_max_depth", overlap_max_depth, AtLeast(0), "of the median depth");
    v("overlap_min_axis_cos", overlap_min_axis_cos, Range(-1, 1), "cosine");
    v("overlap_max_offset", overlap_max_offset, AtLeast(0), "image widths");
    v("overlap_min_points", overlap_min_points, Range(0, 100000), "points");
    v("overlap_ratio", overlap_ratio, Range(0, 1));
    v("overlap_min_agreeing", overlap_min_agreeing, Range(4, 100000), "points");
    v("overlap_agreeing_share", overlap_agreeing_share, Range(0, 1), "of the matches");
    v("final_iterations", final_iterations, Range(1, 10000));
    v("pose", pose);
  }
};

}  // namespace mapmend

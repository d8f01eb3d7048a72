#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connected_frames.h"
#include "libs/connecting/pose_graph_relations.h"
#include "libs/merging/map_positions.h"
#include "libs/merging/merged_bundle_adjustment.h"
#include "libs/merging/overlap_matching.h"
#include "libs/merging/seam_windows.h"
#include "libs/merging/shutter_search.h"
#include "libs/optim/sim3_pose_graph.h"

namespace mapmend {

// A verified relation between keyframes of two submaps, or of one (loop closure), for refinement.
struct RefinementLink {
  int submap_a = -1, submap_b = -1;  // indices into the list of submaps
  KeyframeId keyframe_a, keyframe_b;
  Similarity3 b_from_a;                                    // between the raw submap frames
  bool robust = true;                                      // may be wrong; false: known to agree with all the others
  std::shared_ptr<const WideCommonPoints> wide = nullptr;  // what wide features see on both sides; null: nothing
  // What the evidence itself leaves open; never taken for less than KeyframeRelationOptions::verified.
  RelationSigmas sigmas = {0, 0, 0};
};

struct MergedRefinementOptions {
  PoseGraphOptions pose_graph;
  KeyframeRelationOptions relations;
  // Of keyframes that overlap, by the matches between them: the mean of many points.
  RelationSigmas overlapping = {0.0015, 0.003, 0.003};
  OverlapOptions overlap;
  OverlapMatchingOptions matching;
  MergedBundleOptions bundle;
  // Search radius of each round of fusion and bundle adjustment, pixels: wide while the map is still bent, then narrow.
  std::vector<double> radii = {16, 8, 5};
  std::vector<int> iterations = {6, 8, 15};
  // In the last round all points take part, which evens out the slow bending of long strips (0.73 m became 0.61 m on a
  // survey of 150 keyframes); in larger maps time forbids it.
  int max_keyframes_with_all_points = 400;
  // Of larger maps the overlaps found are first taken into the pose graph, twice: those of keyframes with so many
  // points in common.
  int max_keyframes_without_overlaps = 400;
  int min_points_of_overlap = 20;
  double large_trust_radius =
      1e7;  // and their bundle adjustment begins with such steps that long strips straighten in a few
  int max_keyframes_at_once = 1200;  // beyond, bundle adjustment goes by windows around the seams, in one round
  SeamWindowOptions windows;
  // At the end, in maps that are adjusted at once; if there are any, the last round is done again.
  ShutterSearchOptions shutter;
  MapPositionOptions positions;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("pose_graph", pose_graph);
    v("relations", relations);
    v("overlapping", overlapping);
    v("overlap", overlap);
    v("matching", matching);
    v("bundle", bundle);
    v("radii", radii, MoreThan(0), "pixels at octave 0");
    v("iterations", iterations, Range(1, 10000));
    v("max_keyframes_with_all_points", max_keyframes_with_all_points, Range(0, 1e9), "keyframes");
    v("max_keyframes_without_overlaps", max_keyframes_without_overlaps, Range(0, 1e9), "keyframes");
    v("min_points_of_overlap", min_points_of_overlap, Range(0, 1e6), "points");
    v("large_trust_radius", large_trust_radius, MoreThan(0));
    v("max_keyframes_at_once", max_keyframes_at_once, Range(0, 1e9), "keyframes");
    v("windows", windows);
    v("shutter", shutter);
    v("positions", positions);
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
  // Empty, or which options contradict each other.
  std::string Conflict() const;
};

struct MergedRefinementSummary {
  bool success = false;
  std::string reason;  // one sentence with numbers
  PoseGraphSummary pose_graph;
  std::vector<FusionSummary> fusions;
  std::vector<MergedBundleSummary> bundles;
  // All observations of the refined map, measured with the poses from before (points fitted to them) and after.
  ReprojectionStatistics before, after;
};

struct MergedRefinementResult {
  MergedRefinementSummary summary;
  MergedMap map;                              // of the tree transforms if not successful
  std::vector<Similarity3> root_from_submap;  // best single similarity of each submap in the refined map
};

// Relations of the pose graph over the keyframes of the map: as tracked, and the links whose keyframes are still there.
std::vector<PoseGraphEdge> RefinementRelations(const MergedMap& map, const std::vector<RefinementLink>& links,
                                               const KeyframeRelationOptions& options);

// Refines one component: Sim(3) pose graph over all keyframes with all links, fusion of duplicate points between
// overlapping keyframes of all submaps, bundle adjustment; repeated with narrowing search. The frame stays that of
// submap 0. A refinement that does not lower the reprojection error is not taken. progress(text) is called between the
// stages. open_features: where features are read from; null if the submaps hold them all. positions: of the vehicles,
// as priors that keep long strips from bending; where the windows are adjusted one by one, in the pose graph alone.
MergedRefinementResult RefineMergedMap(const std::vector<SubmapView>& submaps,
                                       const std::vector<Similarity3>& root_from_submap,
                                       const std::vector<RefinementLink>& links, const MergedRefinementOptions& options,
                                       const std::function<void(const std::string&)>& progress = {},
                                       const OpenFeatureSource& open_features = {},
                                       const FlightPositions& positions = {});

}  // namespace mapmend

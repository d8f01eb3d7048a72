#pragma once

#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/base/votes.h"
#include "libs/geometry/chi_square.h"
#include "libs/merging/merged_map.h"
#include "libs/merging/searched_keyframes.h"

namespace mapmend {

// Two keyframes of the merged map that see the same ground.
struct OverlappingPair {
  int a = -1, b = -1;  // a < b
  double overlap = 0;  // fraction of map points of the one predicted inside the other, the smaller of both ways
  int num_shared = 0;  // map points seen in both already
};

struct OverlapOptions {
  double min_overlap = 0.15;
  // Pairs that share this fraction of what they could share already are left out: nothing to gain.
  double max_shared_fraction = 0.5;
  int max_partners = 14;  // per keyframe, largest overlap first
  int num_samples = 40;   // map points per keyframe that stand for all

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_overlap", min_overlap, Range(0, 1), "of the points");
    v("max_shared_fraction", max_shared_fraction, Range(0, 1), "of the points");
    v("max_partners", max_partners, Range(0, 10000), "keyframes");
    v("num_samples", num_samples, Range(1, 1e6), "points");
  }
};

// Pairs of keyframes that overlap by prediction and are not matched well yet, each partner list spread over all
// submaps: this is how neighbouring strips of a survey, of one submap or of several, find each other. Ascending by (a,
// b).
std::vector<OverlappingPair> FindOverlappingPairs(const MergedMap& map, const OverlapOptions& options);

struct OverlapMatchingOptions {
  double radius = 12;  // pixels at octave 0
  int max_distance = 60;
  double ratio = 0.85;
  int octave_tolerance = 2;
  int min_matches = 15;  // of a pair that agree on one pose; fewer: the pair is not trusted
  double min_inlier_rate = 0.4;
  // sigma^2 of an inlier: wide, because the points of the other keyframe carry their own noise on top of the pixel's.
  double outlier_chi2 = kChiSquare2Dof99;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("radius", radius, MoreThan(0), "pixels at octave 0");
    v("max_distance", max_distance, Range(0, 256), "bits");
    v("ratio", ratio, Range(0, 1));
    v("octave_tolerance", octave_tolerance, Range(0, 31), "octaves");
    v("min_matches", min_matches, Range(0, 100000));
    v("min_inlier_rate", min_inlier_rate, Range(0, 1));
    v("outlier_chi2", outlier_chi2, MoreThan(0), "sigma^2");
  }
};

// A map point recognised in a keyframe in which it was not seen before.
struct OverlapMatch {
  int point = -1;        // index into MergedMap::points
  TrackElement element;  // where it was recognised
};

// Projects the points of each of the two keyframes into the other. Matches of a direction count only if enough of them
// agree on one pose of the target camera relative to the source's points, which tolerates the misalignment still in the
// map.
std::vector<OverlapMatch> MatchOverlappingPair(const MergedMap& map, int a, int b,
                                               const OverlapMatchingOptions& options, SearchedKeyframes* searched);

// What matches between two keyframes say about how the map is bent: to_from_from moves the ground about keyframe `from`
// onto the same ground about keyframe `to`, both in the root frame.
struct OverlapRelation {
  int from = -1, to = -1;  // keyframes
  Similarity3 to_from_from;
};

// What a look at all overlapping pairs of a merged map has found. It stays true when keyframes and points are moved.
struct OverlapFindings {
  int num_pairs = 0, num_matched_pairs = 0;
  Votes<std::pair<int, int>> same;           // two points that are one, lesser first; a vote each time it was seen
  Votes<std::pair<int, TrackElement>> seen;  // a point, and where it was recognised
  // Of the pairs in which enough map points of the one are recognised as map points of the other.
  std::vector<OverlapRelation> relations;
};

// min_points: of a relation; 0: none are measured.
OverlapFindings MatchOverlaps(const MergedMap& map, const OverlapOptions& overlap,
                              const OverlapMatchingOptions& matching, int min_points, SearchedKeyframes* searched);

struct FusionSummary {
  int num_pairs = 0, num_matched_pairs = 0;
  int num_fused = 0;      // points fused into others
  int num_added = 0;      // observations added to points
  int num_conflicts = 0;  // refused: a keyframe would see one point twice
};

// Fuses what was found, most often confirmed identities first.
FusionSummary FuseOverlaps(OverlapFindings findings, MergedMap* map);

}  // namespace mapmend

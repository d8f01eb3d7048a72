#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/retrieval/bow_vector.h"
#include "libs/retrieval/inverted_index.h"

// Thresholds of connected-frame retrieval that adapt to the scene (Zhan et al., section 3.3), and the selection they
// serve. How a store answers a query, all of it as of the query's cursors:
//   1. overlaps of the query keyframe q with the other keyframes of its submap -> ChooseNearby
//   2. BoW vectors of q, adjacent and nearby -> ComputeThresholds
//   3. InvertedIndex::Query(bow of q, scope, k) -> hits; without k as well, but slower
//   4. SelectCandidates(...) -> connected-frame candidates, best first
namespace mapmend {

struct ThresholdOptions {
  double nearby_overlap = 0.5;                  // the overlap that nearby should have
  double min_overlap = 0.2, max_overlap = 0.8;  // outside, there is no usable nearby keyframe
  double min_ratio = 0.3, max_ratio = 1.0;      // clamps of k and l
  double default_k = 0.8, default_l = 0.75;     // without a usable nearby keyframe, as ORB-SLAM2

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("nearby_overlap", nearby_overlap, Between(0, 1), "of the points");
    v("min_overlap", min_overlap, Range(0, 1), "of the points");
    v("max_overlap", max_overlap, Range(0, 1), "of the points");
    v("min_ratio", min_ratio, Range(0, 1));
    v("max_ratio", max_ratio, Range(0, 1));
    v("default_k", default_k, Range(0, 1));
    v("default_l", default_l, Range(0, 1));
  }
  // Empty, or which options contradict each other.
  std::string Conflict() const;
};

// Overlap of the query q with one keyframe of its submap: shared map points / map points of q.
struct Overlap {
  int32_t keyframe = -1;
  double value = 0;
};

// The keyframe whose overlap is closest to options.nearby_overlap (ties: smaller id), or -1 if none lies within
// [min_overlap, max_overlap]. adjacent (-1: none) cannot be its own nearby: k and l would always be 1.
int32_t ChooseNearby(const std::vector<Overlap>& overlaps, int32_t adjacent, const ThresholdOptions& options);

struct AdaptiveThresholds {
  int n0 = 0, n1 = 0;        // words that q shares with adjacent, nearby
  double s0 = 0, s1 = 0;     // BoW scores of q with adjacent, nearby
  double k = 0.8, l = 0.75;  // n1 / n0 and s1 / s0, clamped
  bool adapted = false;      // false: k and l are the defaults
};

// adjacent, nearby: nullptr if there is none. Without either, or with nothing in common with one of them, k and l are
// the defaults.
AdaptiveThresholds ComputeThresholds(const BowVector& query, const BowVector* adjacent, const BowVector* nearby,
                                     const ThresholdOptions& options);

struct SelectionOptions {
  int min_common_words = 5;      // fewer are chance
  int max_group_neighbors = 10;  // covisible keyframes whose scores a candidate gathers
  int max_results = 20;          // of a query that does not say how many

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_common_words", min_common_words, Range(0, 1e6), "words");
    v("max_group_neighbors", max_group_neighbors, Range(0, 1e6), "keyframes");
    v("max_results", max_results, Range(1, 200), "keyframes");
  }
};

// A connected-frame candidate: the best keyframe of its covisible group.
struct Candidate {
  int32_t handle = -1;
  int32_t common_words = 0;
  double score = 0;        // of this keyframe alone
  double group_score = 0;  // summed over its group
};

struct Selection {
  std::vector<Candidate> candidates;  // by group score, best first; ties in the order of the hits
  double max_common_words = 0;        // normalised, over all hits
  double best_group_score = 0;
};

// Keeps hits with normalised common words >= k * maximum; sums scores over each hit and those of its covisible
// neighbours that were kept too; keeps groups with a sum >= l * best, and of each its best keyframe (once).
//   hits       as InvertedIndex::Query returns them; their order decides ties
//   covisible  handles covisible with a handle, strongest first, as of the query's cursors; further ones than
//              max_group_neighbors are ignored
Selection SelectCandidates(const std::vector<IndexHit>& hits, int num_query_words, const AdaptiveThresholds& thresholds,
                           const std::function<std::vector<int32_t>(int32_t handle)>& covisible,
                           const SelectionOptions& options);

}  // namespace mapmend

#include "libs/retrieval/adaptive_thresholds.h"

#include <algorithm>
#include <cmath>

namespace mapmend {

std::string ThresholdOptions::Conflict() const {
  if (min_overlap > nearby_overlap || max_overlap < nearby_overlap)
    return "nearby_overlap must lie between min_overlap and max_overlap";
  return min_ratio <= max_ratio ? "" : "min_ratio must not be more than max_ratio";
}

int32_t ChooseNearby(const std::vector<Overlap>& overlaps, int32_t adjacent, const ThresholdOptions& options) {
  int32_t best = -1;
  double best_distance = 0;
  for (const Overlap& o : overlaps) {
    if (o.keyframe == adjacent || !(o.value >= options.min_overlap && o.value <= options.max_overlap)) continue;
    const double distance = std::abs(o.value - options.nearby_overlap);
    if (best < 0 || distance < best_distance || (distance == best_distance && o.keyframe < best)) {
      best = o.keyframe;
      best_distance = distance;
    }
  }
  return best;
}

AdaptiveThresholds ComputeThresholds(const BowVector& query, const BowVector* adjacent, const BowVector* nearby,
                                     const ThresholdOptions& options) {
  AdaptiveThresholds t;
  t.k = options.default_k;
  t.l = options.default_l;
  if (adjacent) {
    t.n0 = CountCommonWords(query, *adjacent);
    t.s0 = BowScore(query, *adjacent);
  }
  if (nearby) {
    t.n1 = CountCommonWords(query, *nearby);
    t.s1 = BowScore(query, *nearby);
  }
  if (t.n0 > 0 && t.n1 > 0 && t.s0 > 0 && t.s1 > 0) {
    t.k = std::clamp(static_cast<double>(t.n1) / t.n0, options.min_ratio, options.max_ratio);
    t.l = std::clamp(t.s1 / t.s0, options.min_ratio, options.max_ratio);
    t.adapted = true;
  }
  return t;
}

Selection SelectCandidates(const std::vector<IndexHit>& hits, int num_query_words, const AdaptiveThresholds& thresholds,
                           const std::function<std::vector<int32_t>(int32_t handle)>& covisible,
                           const SelectionOptions& options) {
  Selection selection;
  std::vector<double> normalized;
  normalized.reserve(hits.size());
  for (const IndexHit& hit : hits) {
    normalized.push_back(NormalizedCommonWords(hit.common_words, hit.num_words, num_query_words));
    selection.max_common_words = std::max(selection.max_common_words, normalized.back());
  }
  const double min_common_words = std::max<double>(options.min_common_words, thresholds.k * selection.max_common_words);
  std::vector<IndexHit> kept;
  std::vector<std::pair<int32_t, size_t>> positions;  // handle, position in kept
  for (size_t i = 0; i < hits.size(); ++i) {
    if (normalized[i] < min_common_words) continue;
    positions.emplace_back(hits[i].handle, kept.size());
    kept.push_back(hits[i]);
  }
  std::sort(positions.begin(), positions.end());

  // Per kept hit, the best sum of any group it is the best keyframe of.
  std::vector<double> group_score(kept.size(), 0);
  for (size_t i = 0; i < kept.size(); ++i) {
    double sum = kept[i].score;
    size_t best = i;
    int num_neighbors = 0;
    for (const int32_t neighbor : covisible(kept[i].handle)) {
      if (num_neighbors++ == options.max_group_neighbors) break;
      const auto it = std::lower_bound(positions.begin(), positions.end(), std::pair<int32_t, size_t>(neighbor, 0));
      if (it == positions.end() || it->first != neighbor || it->second == i) continue;
      const size_t j = it->second;
      sum += kept[j].score;
      if (kept[j].score > kept[best].score || (kept[j].score == kept[best].score && j < best)) best = j;
    }
    group_score[best] = std::max(group_score[best], sum);
    selection.best_group_score = std::max(selection.best_group_score, sum);
  }

  for (size_t i = 0; i < kept.size(); ++i) {
    if (group_score[i] > 0 && group_score[i] >= thresholds.l * selection.best_group_score) {
      selection.candidates.push_back({kept[i].handle, kept[i].common_words, kept[i].score, group_score[i]});
    }
  }
  std::stable_sort(selection.candidates.begin(), selection.candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.group_score > b.group_score; });
  if (static_cast<int>(selection.candidates.size()) > options.max_results) {
    selection.candidates.resize(std::max(0, options.max_results));
  }
  return selection;
}

}  // namespace mapmend

#include "libs/features/matching.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace mapmend {
namespace {

constexpr int kRotationBins = 30;
constexpr int kRotationBinsKept = 3;

struct Best {
  int index = -1, distance = 257, second = 257;

  void Add(int i, int d) {
    if (d < distance) {
      second = distance;
      distance = d;
      index = i;
    } else if (d < second) {
      second = d;
    }
  }
  bool Passes(const MatchOptions& options) const {
    return index >= 0 && distance <= options.max_distance && distance < options.ratio * second;
  }
};

std::vector<int> AllOr(const std::vector<int>& mask, int size) {
  if (!mask.empty()) return mask;
  std::vector<int> all(size);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// Part of a list of feature indices.
struct IndexRange {
  const int* first = nullptr;
  size_t size = 0;
  int operator[](size_t i) const { return first[i]; }
};

// Reused from call to call: there are many short ones.
struct MatchScratch {
  std::vector<Best> best_of_a, best_of_b;
};

// Matches the features of two index lists.
void MatchLists(const Features& a, const IndexRange& list_a, const Features& b, const IndexRange& list_b,
                const MatchOptions& options, MatchScratch* scratch, std::vector<Match>* matches) {
  std::vector<Best>&best_of_a = scratch->best_of_a, &best_of_b = scratch->best_of_b;
  best_of_a.assign(list_a.size, {});
  best_of_b.assign(options.mutual ? list_b.size : 0, {});
  for (size_t i = 0; i < list_a.size; ++i) {
    const Descriptor& descriptor = a.descriptors[list_a[i]];
    Best& best = best_of_a[i];
    for (size_t j = 0; j < list_b.size; ++j) {
      const int distance = HammingDistance(descriptor, b.descriptors[list_b[j]]);
      best.Add(static_cast<int>(j), distance);
      if (options.mutual && distance < best_of_b[j].distance) best_of_b[j] = {static_cast<int>(i), distance, 0};
    }
  }
  for (size_t i = 0; i < list_a.size; ++i) {
    const Best& best = best_of_a[i];
    if (!best.Passes(options)) continue;
    if (options.mutual && best_of_b[best.index].index != static_cast<int>(i)) continue;
    matches->push_back({list_a[i], list_b[best.index], best.distance});
  }
}

// Without the mutual check two features of a may claim one of b: the nearer keeps it.
void KeepOnePerTarget(std::vector<Match>* matches) {
  std::stable_sort(matches->begin(), matches->end(), [](const Match& l, const Match& r) {
    return std::pair(l.b, l.distance) < std::pair(r.b, r.distance);
  });
  matches->erase(
      std::unique(matches->begin(), matches->end(), [](const Match& l, const Match& r) { return l.b == r.b; }),
      matches->end());
  std::sort(matches->begin(), matches->end(), [](const Match& l, const Match& r) { return l.a < r.a; });
}

void Finish(const Features& a, const Features& b, const MatchOptions& options, std::vector<Match>* matches) {
  KeepOnePerTarget(matches);
  if (options.check_orientation) FilterByOrientation(a, b, matches);
}

}  // namespace

std::vector<Match> MatchBruteForce(const Features& a, const Features& b, const MatchOptions& options,
                                   const std::vector<int>& mask_a, const std::vector<int>& mask_b) {
  const std::vector<int> list_a = AllOr(mask_a, a.Size()), list_b = AllOr(mask_b, b.Size());
  MatchScratch scratch;
  std::vector<Match> matches;
  MatchLists(a, {list_a.data(), list_a.size()}, b, {list_b.data(), list_b.size()}, options, &scratch, &matches);
  Finish(a, b, options, &matches);
  return matches;
}

std::vector<Match> MatchByNodes(const Features& a, const std::vector<int32_t>& nodes_a, const Features& b,
                                const std::vector<int32_t>& nodes_b, const MatchOptions& options,
                                const std::vector<int>& mask_a, const std::vector<int>& mask_b) {
  const auto by_node = [](const std::vector<int32_t>& nodes, std::vector<int> list) {
    std::erase_if(list, [&](int i) { return nodes[i] < 0; });
    std::stable_sort(list.begin(), list.end(), [&](int l, int r) { return nodes[l] < nodes[r]; });
    return list;
  };
  const std::vector<int> list_a = by_node(nodes_a, AllOr(mask_a, a.Size()));
  const std::vector<int> list_b = by_node(nodes_b, AllOr(mask_b, b.Size()));
  MatchScratch scratch;
  std::vector<Match> matches;
  for (size_t i = 0, j = 0; i < list_a.size() && j < list_b.size();) {
    const int node_a = nodes_a[list_a[i]], node_b = nodes_b[list_b[j]];
    size_t i_end = i, j_end = j;
    while (i_end < list_a.size() && nodes_a[list_a[i_end]] == node_a) ++i_end;
    while (j_end < list_b.size() && nodes_b[list_b[j_end]] == node_b) ++j_end;
    if (node_a == node_b) {
      MatchLists(a, {list_a.data() + i, i_end - i}, b, {list_b.data() + j, j_end - j}, options, &scratch, &matches);
    }
    if (node_a <= node_b) i = i_end;
    if (node_b <= node_a) j = j_end;
  }
  Finish(a, b, options, &matches);
  return matches;
}

void FilterByOrientation(const Features& a, const Features& b, std::vector<Match>* matches) {
  constexpr double kTwoPi = 2 * M_PI;
  const auto bin = [&](const Match& m) {
    double turn = b.keypoints[m.b].angle - a.keypoints[m.a].angle;
    turn -= kTwoPi * std::floor(turn / kTwoPi);
    return static_cast<int>(std::lround(turn / kTwoPi * kRotationBins)) % kRotationBins;
  };
  std::array<int, kRotationBins> histogram{}, order;
  for (const Match& m : *matches) ++histogram[bin(m)];
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int l, int r) { return histogram[l] > histogram[r]; });
  std::array<bool, kRotationBins> keep{};
  for (int i = 0; i < kRotationBinsKept; ++i) {
    if (histogram[order[i]] * 10 >= histogram[order[0]]) keep[order[i]] = true;
  }
  std::erase_if(*matches, [&](const Match& m) { return !keep[bin(m)]; });
}

FeatureGrid::FeatureGrid(const std::vector<Keypoint>& keypoints, int width, int height, int cell_size)
    : cell_size_(cell_size),
      columns_(std::max(1, (width + cell_size - 1) / cell_size)),
      rows_(std::max(1, (height + cell_size - 1) / cell_size)),
      first_(columns_ * rows_ + 1, 0),
      indices_(keypoints.size()) {
  const auto cell = [&](const Keypoint& k) {
    return Cell(k.pixel.y(), rows_) * columns_ + Cell(k.pixel.x(), columns_);
  };
  for (const Keypoint& k : keypoints) ++first_[cell(k) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  std::vector<int> next(first_.begin(), first_.end() - 1);
  for (size_t i = 0; i < keypoints.size(); ++i) indices_[next[cell(keypoints[i])]++] = static_cast<int>(i);
}

// Undistorted pixels may lie outside the image: they go to the border cells.
int FeatureGrid::Cell(float v, int count) const {
  return static_cast<int>(
      std::clamp(std::floor(v / static_cast<float>(cell_size_)), 0.0f, static_cast<float>(count - 1)));
}

Match FindNear(const Features& features, const FeatureGrid& grid, const Eigen::Vector2f& pixel,
               const Descriptor& descriptor, const GuidedSearch& search, const std::vector<uint8_t>& used) {
  Match best;
  int second = 257, best_octave = -1, second_octave = -1;
  const float radius2 = search.radius * search.radius;
  grid.VisitNear(pixel, search.radius, [&](int i) {
    const Keypoint& keypoint = features.keypoints[i];
    if (keypoint.octave < search.min_octave || keypoint.octave > search.max_octave) return;
    if (!used.empty() && used[i]) return;
    if ((keypoint.pixel - pixel).squaredNorm() > radius2) return;
    const int distance = HammingDistance(descriptor, features.descriptors[i]);
    if (distance < best.distance || (distance == best.distance && i < best.b)) {
      second = best.distance;
      second_octave = best_octave;
      best.distance = distance;
      best.b = i;
      best_octave = keypoint.octave;
    } else if (distance < second) {
      second = distance;
      second_octave = keypoint.octave;
    }
  });
  // A rival far away in scale is another thing; one of like scale makes the match ambiguous.
  const bool rival = second <= 256 && std::abs(best_octave - second_octave) <= 1;
  if (best.b >= 0 && (best.distance > search.max_distance || (rival && best.distance >= search.ratio * second)))
    return {};
  return best;
}

}  // namespace mapmend

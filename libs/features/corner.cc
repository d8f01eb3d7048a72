#include "libs/features/corner.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace mapmend {
namespace {

// Spreads the 16 bits of v to the even bits of the result.
uint32_t SpreadBits(uint32_t v) {
  v = (v | (v << 8)) & 0x00ff00ffu;
  v = (v | (v << 4)) & 0x0f0f0f0fu;
  v = (v | (v << 2)) & 0x33333333u;
  return (v | (v << 1)) & 0x55555555u;
}

struct Coded {
  uint32_t code;  // Morton code: sorted by it, the corners of every quadtree node are one range
  Corner corner;
};

struct Node {
  int begin, end;
  int shift;  // node size is 2^(shift / 2) pixels

  int Count() const { return end - begin; }
  bool CanSplit() const { return Count() > 1 && shift > 0; }
};

// Appends the non-empty quarters of node.
void Split(const std::vector<Coded>& coded, const Node& node, std::vector<Node>* nodes) {
  const int shift = node.shift - 2;
  int begin = node.begin;
  while (begin < node.end) {
    const uint32_t quarter = coded[begin].code >> shift;
    const auto end = std::partition_point(coded.begin() + begin, coded.begin() + node.end,
                                          [&](const Coded& c) { return (c.code >> shift) == quarter; });
    nodes->push_back({begin, static_cast<int>(end - coded.begin()), shift});
    begin = nodes->back().end;
  }
}

bool IsStronger(const Coded& a, const Coded& b) {
  return a.corner.strength != b.corner.strength ? a.corner.strength > b.corner.strength : a.code < b.code;
}

std::vector<Node> BuildQuadtree(const std::vector<Coded>& coded, int num_wanted) {
  std::vector<Node> nodes = {{0, static_cast<int>(coded.size()), 32}}, next;
  while (static_cast<int>(nodes.size()) < num_wanted) {
    next.clear();
    for (const Node& node : nodes) {
      if (node.CanSplit()) {
        Split(coded, node, &next);
      } else {
        next.push_back(node);
      }
    }
    if (static_cast<int>(next.size()) > num_wanted) break;
    if (next.size() == nodes.size() &&
        std::none_of(next.begin(), next.end(), [](const Node& n) { return n.CanSplit(); })) {
      return nodes;
    }
    nodes.swap(next);
  }
  // Splitting all would give too many: the fullest first, until there are enough.
  std::stable_sort(nodes.begin(), nodes.end(), [](const Node& a, const Node& b) { return a.Count() > b.Count(); });
  next.clear();
  size_t i = 0;
  for (; i < nodes.size() && static_cast<int>(next.size() + nodes.size() - i) < num_wanted; ++i) {
    if (nodes[i].CanSplit()) {
      Split(coded, nodes[i], &next);
    } else {
      next.push_back(nodes[i]);
    }
  }
  next.insert(next.end(), nodes.begin() + i, nodes.end());
  return next;
}

}  // namespace

std::vector<Corner> SelectSpread(const std::vector<Corner>& corners, int num_wanted, int per_node) {
  if (num_wanted <= 0 || corners.empty()) return {};
  std::vector<Coded> coded;
  coded.reserve(corners.size());
  for (const Corner& c : corners) {
    coded.push_back({SpreadBits(static_cast<uint16_t>(c.x)) | (SpreadBits(static_cast<uint16_t>(c.y)) << 1), c});
  }
  const auto by_code = [](const Coded& a, const Coded& b) { return a.code < b.code; };
  std::sort(coded.begin(), coded.end(), by_code);

  std::vector<Coded> kept, others;
  for (const Node& node : BuildQuadtree(coded, std::max(1, num_wanted / per_node))) {
    const auto begin = coded.begin() + node.begin, end = coded.begin() + node.end;
    const auto limit = begin + std::min(per_node, node.Count());
    std::partial_sort(begin, limit, end, IsStronger);
    kept.insert(kept.end(), begin, limit);
    others.insert(others.end(), limit, end);
  }
  const int num_missing = std::min(num_wanted - static_cast<int>(kept.size()), static_cast<int>(others.size()));
  if (num_missing > 0) {
    std::nth_element(others.begin(), others.begin() + num_missing - 1, others.end(), IsStronger);
    kept.insert(kept.end(), others.begin(), others.begin() + num_missing);
  } else if (static_cast<int>(kept.size()) > num_wanted) {
    std::nth_element(kept.begin(), kept.begin() + num_wanted, kept.end(), IsStronger);
    kept.resize(num_wanted);
  }
  std::sort(kept.begin(), kept.end(), by_code);
  std::vector<Corner> selected;
  selected.reserve(kept.size());
  for (const Coded& c : kept) selected.push_back(c.corner);
  return selected;
}

std::vector<Corner> Preselect(std::vector<Corner> corners, int width, int height, int num_wanted) {
  const size_t enough = 4 * static_cast<size_t>(std::max(1, num_wanted));
  int per_square = 16;
  if (corners.size() <= enough) return corners;
  const int side =
      std::max(8, static_cast<int>(std::sqrt(static_cast<double>(width) * height / std::max(1, num_wanted))));
  const int columns = width / side + 1, rows = height / side + 1;
  // Counting sort by square. What is sorted are numbers in the order of preference: score, then reading order.
  std::vector<int> first(static_cast<size_t>(columns) * rows + 1, 0);
  std::vector<int> column_of(width), row_of(height);
  for (int x = 0; x < width; ++x) column_of[x] = x / side;
  for (int y = 0; y < height; ++y) row_of[y] = y / side * columns;
  const auto square = [&](const Corner& c) { return row_of[c.y] + column_of[c.x]; };
  for (const Corner& c : corners) ++first[square(c) + 1];
  for (size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  std::vector<uint64_t> sorted(corners.size());
  std::vector<int> at(first.begin(), first.end() - 1);
  constexpr uint64_t kMaxScore = std::numeric_limits<int16_t>::max();
  for (const Corner& c : corners) {
    sorted[at[square(c)]++] = ((kMaxScore - static_cast<uint64_t>(c.score)) << 32) |
                              (static_cast<uint64_t>(c.y) << 16) | static_cast<uint64_t>(c.x);
  }

  const auto kept_at = [&](int limit) {
    size_t kept = 0;
    for (size_t i = 0; i + 1 < first.size(); ++i) kept += std::min(limit, first[i + 1] - first[i]);
    return kept;
  };
  while (kept_at(per_square) < enough) per_square *= 2;
  corners.clear();
  for (size_t i = 0; i + 1 < first.size(); ++i) {
    const auto begin = sorted.begin() + first[i], end = sorted.begin() + first[i + 1];
    const auto limit = begin + std::min<std::ptrdiff_t>(per_square, end - begin);
    if (limit != end) std::nth_element(begin, limit, end);
    for (auto key = begin; key != limit; ++key) {
      corners.push_back({static_cast<int16_t>(*key & 0xffff), static_cast<int16_t>((*key >> 16) & 0xffff),
                         static_cast<int16_t>(kMaxScore - (*key >> 32))});
    }
  }
  return corners;
}

std::vector<int> ShareOut(const std::vector<double>& weights, const std::vector<int>& available, int num_wanted) {
  const int num_levels = static_cast<int>(weights.size());
  std::vector<int> share(num_levels, 0);
  int left = num_wanted;
  // Each round either fills a level or ends.
  while (left > 0) {
    double open_weight = 0;
    for (int i = 0; i < num_levels; ++i) {
      if (share[i] < available[i]) open_weight += weights[i];
    }
    if (open_weight <= 0) break;
    const int to_share = left;
    double cumulative = 0;
    int given = 0;
    for (int i = 0; i < num_levels; ++i) {
      if (share[i] >= available[i]) continue;
      // Rounding the running sum keeps the total exact.
      cumulative += weights[i];
      const int upto = static_cast<int>(to_share * (cumulative / open_weight) + 0.5);
      const int add = std::min(upto - given, available[i] - share[i]);
      given = upto;
      share[i] += add;
      left -= add;
    }
  }
  return share;
}

}  // namespace mapmend

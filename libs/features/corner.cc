#include "libs/features/corner.h"

#include <algorithm>
#include <tuple>

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

bool IsBetter(const Corner& a, const Corner& b) {
  return std::tuple(-a.score, a.y, a.x) < std::tuple(-b.score, b.y, b.x);
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

std::vector<Corner> SelectSpread(const std::vector<Corner>& corners, int num_wanted) {
  if (num_wanted <= 0 || corners.empty()) return {};
  std::vector<Coded> coded;
  coded.reserve(corners.size());
  for (const Corner& c : corners) {
    coded.push_back({SpreadBits(static_cast<uint16_t>(c.x)) | (SpreadBits(static_cast<uint16_t>(c.y)) << 1), c});
  }
  const auto by_code = [](const Coded& a, const Coded& b) { return a.code < b.code; };
  std::sort(coded.begin(), coded.end(), by_code);

  std::vector<Coded> kept;
  for (const Node& node : BuildQuadtree(coded, num_wanted)) {
    kept.push_back(*std::min_element(coded.begin() + node.begin, coded.begin() + node.end,
                                     [](const Coded& a, const Coded& b) { return IsBetter(a.corner, b.corner); }));
  }
  if (static_cast<int>(kept.size()) > num_wanted) {
    std::nth_element(kept.begin(), kept.begin() + num_wanted, kept.end(),
                     [](const Coded& a, const Coded& b) { return IsBetter(a.corner, b.corner); });
    kept.resize(num_wanted);
  }
  std::sort(kept.begin(), kept.end(), by_code);
  std::vector<Corner> selected;
  selected.reserve(kept.size());
  for (const Coded& c : kept) selected.push_back(c.corner);
  return selected;
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

#pragma once

#include <cstdint>
#include <vector>

namespace mapmend {

// A FAST corner of one pyramid level: pixel of that level and score, the largest threshold at which it is still a
// corner.
struct Corner {
  int16_t x = 0, y = 0;
  uint8_t score = 0;
};

// Picks at most num_wanted corners spread evenly over the image: a quadtree is split, fullest node first, until it has
// that many nodes, and the best corner of each node is kept (ties: smallest y, then x). Copes with any image shape; the
// result is ordered along the Morton curve and does not depend on the order of the input.
std::vector<Corner> SelectSpread(const std::vector<Corner>& corners, int num_wanted);

// Shares num_wanted among levels in proportion to weight, but gives no level more than it has: what one cannot use goes
// to the others. Returns one count per level; their sum is min(num_wanted, sum of available).
std::vector<int> ShareOut(const std::vector<double>& weights, const std::vector<int>& available, int num_wanted);

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <vector>

namespace mapmend {

// A FAST corner of one pyramid level, in pixels of that level.
struct Corner {
  int16_t x = 0, y = 0;
  int16_t score = 0;   // FAST: the largest threshold at which it is still a corner
  float strength = 0;  // Harris: how well its position is defined; by this corners are chosen
};

// Picks at most num_wanted corners spread evenly over the image. A quadtree is split, fullest node first, until it has
// num_wanted / per_node nodes, and the per_node strongest corners of each are kept; if that leaves room, the strongest
// of the others. (Strictly one per node would take many weak corners, which are not found again in the next image.)
// Ties go to the corner that comes first in Morton order. Copes with any image shape. The result is in Morton order and
// does not depend on the order of the input.
std::vector<Corner> SelectSpread(const std::vector<Corner>& corners, int num_wanted, int per_node);

// Reduces many corners to about num_wanted * 16 before the costly Harris strength is computed: the image is divided
// into about num_wanted squares, and of each the 16 corners with the highest score stay (more if that would be too few
// in all). Exact ties at the limit: in reading order.
std::vector<Corner> Preselect(std::vector<Corner> corners, int width, int height, int num_wanted);

// Shares num_wanted among levels in proportion to weight, but gives no level more than it has: what one cannot use goes
// to the others. Returns one count per level; their sum is min(num_wanted, sum of available).
std::vector<int> ShareOut(const std::vector<double>& weights, const std::vector<int>& available, int num_wanted);

}  // namespace mapmend

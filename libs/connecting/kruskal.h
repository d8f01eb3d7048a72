#pragma once

#include <vector>

#include "libs/geometry/similarity3.h"

namespace mapmend {

// An edge of an undirected graph whose vertices are 0 .. n - 1.
struct WeightedEdge {
  int a = -1, b = -1;
  double weight = 0;
};

struct SpanningForest {
  std::vector<int> edges;      // indices of the chosen edges, in the order they were chosen: strongest first
  std::vector<int> component;  // per vertex; components are numbered by their lowest vertex, ascending
  int num_components = 0;
};

// An edge of the forest with its transform.
struct TreeEdge {
  int a = -1, b = -1;
  Similarity3 b_from_a;
};

// Maximum spanning forest: Kruskal (Proc. AMS 1956) on the negated weights (paper §3.5). Ties go to the lower edge
// index, so the result is a function of the input alone.
SpanningForest MaximumSpanningForest(int num_vertices, const std::vector<WeightedEdge>& edges);

}  // namespace mapmend

#include "libs/connecting/kruskal.h"

#include <algorithm>
#include <numeric>

namespace mapmend {

SpanningForest MaximumSpanningForest(int num_vertices, const std::vector<WeightedEdge>& edges) {
  std::vector<int> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int l, int r) { return edges[l].weight > edges[r].weight; });

  std::vector<int> parent(num_vertices);
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  SpanningForest forest;
  for (const int i : order) {
    const int a = find(edges[i].a), b = find(edges[i].b);
    if (a == b) continue;
    parent[std::max(a, b)] = std::min(a, b);  // the root of a set is its lowest vertex
    forest.edges.push_back(i);
  }
  forest.component.assign(num_vertices, -1);
  for (int v = 0; v < num_vertices; ++v) {
    const int root = find(v);
    forest.component[v] = root == v ? forest.num_components++ : forest.component[root];
  }
  return forest;
}

}  // namespace mapmend

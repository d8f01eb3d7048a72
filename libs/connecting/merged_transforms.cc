#include "libs/connecting/merged_transforms.h"

#include <map>

namespace mapmend {

std::vector<MergedPlace> ComposeAlongForest(int num_vertices, const std::vector<TreeEdge>& forest,
                                            const std::vector<RefinedPlace>& refined) {
  struct Neighbour {
    int vertex;
    Similarity3 this_from_neighbour;
  };
  std::vector<std::vector<Neighbour>> neighbours(num_vertices);
  for (const TreeEdge& e : forest) {
    neighbours[e.a].push_back({e.b, e.b_from_a.Inverse()});
    neighbours[e.b].push_back({e.a, e.b_from_a});
  }
  std::vector<MergedPlace> places(num_vertices);
  for (int root = 0; root < num_vertices; ++root) {
    if (places[root].root >= 0) continue;
    std::map<int, Similarity3> root_from_group;
    const auto place = [&](int v, const MergedPlace& by_edge) {
      places[v] = by_edge;
      if (refined.empty() || refined[v].group < 0) return;
      const auto known = root_from_group.find(refined[v].group);
      if (known != root_from_group.end()) {
        places[v].root_from_vertex = known->second * refined[v].group_from_vertex;
      } else {
        root_from_group[refined[v].group] = by_edge.root_from_vertex * refined[v].group_from_vertex.Inverse();
      }
    };
    place(root, {root, -1, 0, Similarity3()});
    std::vector<int> open = {root};
    while (!open.empty()) {
      const int v = open.back();
      open.pop_back();
      for (const Neighbour& n : neighbours[v]) {
        if (places[n.vertex].root >= 0) continue;
        place(n.vertex, {root, v, places[v].depth + 1, places[v].root_from_vertex * n.this_from_neighbour});
        open.push_back(n.vertex);
      }
    }
  }
  return places;
}

}  // namespace mapmend

#include "procs/merger/merged_transforms.h"

namespace mapmend {

std::vector<MergedPlace> ComposeAlongForest(int num_vertices, const std::vector<TreeEdge>& forest) {
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
    places[root].root = root;
    std::vector<int> open = {root};
    while (!open.empty()) {
      const int v = open.back();
      open.pop_back();
      for (const Neighbour& n : neighbours[v]) {
        MergedPlace& place = places[n.vertex];
        if (place.root >= 0) continue;
        place = {root, v, places[v].depth + 1, places[v].root_from_vertex * n.this_from_neighbour};
        open.push_back(n.vertex);
      }
    }
  }
  return places;
}

}  // namespace mapmend

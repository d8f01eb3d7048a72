// Which submaps of a map in pieces belong together, and by which connections? Reads connections, one a line,
//     submap submap F M theta_deg
// from the standard input, and prints the strongest forest: Kruskal on the connection strengths (paper sections 3.4 and
// 3.5).
//     $ printf 'A B 3 50 10\nB C 1 10 5\nA C 4 60 20\nD E 2 30 10\n' | connection_graph

#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "mapmend/connecting/connection_strength.h"
#include "mapmend/connecting/kruskal.h"

int main() {
  std::map<std::string, int> vertices;
  std::vector<std::string> names;
  const auto vertex = [&](const std::string& name) {
    const auto [found, is_new] = vertices.emplace(name, static_cast<int>(names.size()));
    if (is_new) names.push_back(name);
    return found->second;
  };

  std::vector<mapmend::WeightedEdge> edges;
  std::string a, b;
  int num_connected_frames = 0, num_common_points = 0;
  double angle_deg = 0;
  while (std::cin >> a >> b >> num_connected_frames >> num_common_points >> angle_deg) {
    const int first = vertex(a), second = vertex(b);
    edges.push_back({first, second, mapmend::ConnectionStrength(num_connected_frames, num_common_points, angle_deg)});
  }

  const mapmend::SpanningForest forest = mapmend::MaximumSpanningForest(static_cast<int>(names.size()), edges);
  std::cout << names.size() << " submaps, " << edges.size() << " connections, " << forest.num_components << " maps\n";
  for (const int e : forest.edges) {
    std::cout << names[edges[e].a] << " - " << names[edges[e].b] << ", C = " << edges[e].weight << "\n";
  }
}

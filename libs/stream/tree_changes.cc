#include "libs/stream/tree_changes.h"

#include <algorithm>

namespace mapmend {

std::vector<TreeChange> TreeChanges::Update(const MergedTransforms& transforms) {
  std::set<Edge> edges;
  for (const auto& [i, j] : transforms.edges) {
    const SubmapKey& first = std::min(transforms.submaps[i].key, transforms.submaps[j].key);
    const SubmapKey& second = std::max(transforms.submaps[i].key, transforms.submaps[j].key);
    edges.emplace(first.session, first.submap.value, second.session, second.submap.value);
  }
  std::vector<TreeChange> changes;
  const auto add = [&](const Edge& edge, bool joined) {
    changes.push_back({std::get<0>(edge), std::get<2>(edge), std::get<1>(edge), std::get<3>(edge), joined});
  };
  for (const Edge& edge : edges_) {
    if (!edges.contains(edge)) add(edge, false);
  }
  for (const Edge& edge : edges) {
    if (!edges_.contains(edge)) add(edge, true);
  }
  edges_ = std::move(edges);
  return changes;
}

std::string DescribePair(const TreeChange& change) {
  const auto name = [&](const std::string& session, int submap) {
    return "submap " + (change.session_a == change.session_b ? "" : session.substr(0, 8) + ":") +
           std::to_string(submap);
  };
  return name(change.session_a, change.submap_a) + " and " + name(change.session_b, change.submap_b);
}

}  // namespace mapmend

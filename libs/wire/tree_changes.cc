#include "libs/wire/tree_changes.h"

#include <algorithm>
#include <mapmend/merged_transforms_t.hpp>

namespace mapmend {

std::vector<TreeChange> TreeChanges::Update(const merged_transforms_t& message) {
  std::set<Edge> edges;
  for (size_t i = 0; i < message.edge_a.size() && i < message.edge_b.size(); ++i) {
    const auto num_submaps = static_cast<int>(message.submaps.size());
    if (std::min(message.edge_a[i], message.edge_b[i]) < 0 ||
        std::max(message.edge_a[i], message.edge_b[i]) >= num_submaps)
      continue;
    const merged_submap_t &a = message.submaps[message.edge_a[i]], &b = message.submaps[message.edge_b[i]];
    const bool in_order = std::tie(a.session, a.submap) <= std::tie(b.session, b.submap);
    const merged_submap_t &first = in_order ? a : b, &second = in_order ? b : a;
    edges.emplace(first.session, first.submap, second.session, second.submap);
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

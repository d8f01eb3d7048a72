#pragma once

#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"

// The connection graph: submaps, what connects them, and which connections form the tree.
namespace mapmend {

// An evaluated pair with both ends in the snapshot; a < b are indices into Snapshot::submaps.
struct GraphEdge {
  int a = 0, b = 0;
  const EvaluatedConnection* connection = nullptr;
};

// Ascending by (a, b). Connections that name a submap not in the snapshot are left out.
std::vector<GraphEdge> ListEdges(const Snapshot& snapshot);

// Connections of a submap with itself: loop closures within it. Ascending by submap.
std::vector<GraphEdge> ListLoops(const Snapshot& snapshot);

// Graphviz text (undirected): submaps coloured and grouped by component, accepted connections labelled with F, M, theta
// and C, the tree bold, rejected and deactivated connections dashed grey.
std::string MakeGraphDot(const Snapshot& snapshot);

// The same as SVG, drawn here so that nothing need be installed. Submaps stand in a column in the order of time with
// the loss between them on the left; connections are brackets on the right, in lanes, so that labels never overlap.
std::string MakeGraphSvg(const Snapshot& snapshot);

// "Submap 3" for a person.
std::string SubmapName(const SnapshotSubmap& submap);
// "too_few_matches" to "too few matches".
std::string ReadableReason(const std::string& reason);

}  // namespace mapmend

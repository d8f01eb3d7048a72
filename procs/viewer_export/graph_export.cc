#include "procs/viewer_export/graph_export.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "libs/drawing/canvas.h"

namespace mapmend {
namespace {

using Verdict = EvaluatedConnection::Verdict;

std::string DotQuote(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c == '\n' ? ' ' : c;
  }
  return quoted + "\"";
}

std::string EdgeLabel(const EvaluatedConnection& c) {
  char text[128];
  std::snprintf(text, sizeof(text), "F %d  M %d  θ %.1f°\\nC %.1f", c.num_connected_frames, c.num_common_points,
                c.median_angle_deg, c.strength);
  std::string label = text;
  if (KindOf(c) != ConnectionKind::kOrb) label += std::string("\\n") + ToString(KindOf(c));
  return label + (IsWeak(c) ? "\\nweak" : "");
}

}  // namespace

std::vector<GraphEdge> ListEdges(const Snapshot& snapshot) {
  std::vector<GraphEdge> edges;
  for (const EvaluatedConnection& connection : snapshot.model->Revision().connections) {
    GraphEdge edge{snapshot.FindSubmap(connection.a), snapshot.FindSubmap(connection.b), &connection};
    if (edge.a < 0 || edge.b < 0 || edge.a == edge.b) continue;
    if (edge.a > edge.b) std::swap(edge.a, edge.b);
    edges.push_back(edge);
  }
  std::stable_sort(edges.begin(), edges.end(), [](const GraphEdge& x, const GraphEdge& y) {
    return std::make_pair(x.a, x.b) < std::make_pair(y.a, y.b);
  });
  return edges;
}

std::vector<GraphEdge> ListLoops(const Snapshot& snapshot) {
  std::vector<GraphEdge> loops;
  for (const EvaluatedConnection& connection : snapshot.model->Revision().connections) {
    const int submap = snapshot.FindSubmap(connection.a);
    if (submap >= 0 && connection.a == connection.b) loops.push_back({submap, submap, &connection});
  }
  std::stable_sort(loops.begin(), loops.end(), [](const GraphEdge& x, const GraphEdge& y) { return x.a < y.a; });
  return loops;
}

std::string SubmapName(const SnapshotSubmap& submap) { return "Submap " + std::to_string(submap.number); }

std::string ReadableReason(const std::string& reason) {
  std::string text = reason;
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

std::string MakeGraphDot(const Snapshot& snapshot) {
  std::string dot = "graph mapmend {\n  graph [fontname=\"sans-serif\", overlap=false]\n";
  dot += "  node [shape=circle, style=filled, fontname=\"sans-serif\", fontcolor=white, penwidth=0]\n";
  dot += "  edge [fontname=\"sans-serif\", fontsize=10]\n";
  for (size_t c = 0; c < snapshot.components.size(); ++c) {
    const SnapshotComponent& component = snapshot.components[c];
    const std::string id = std::to_string(c);
    dot += "  subgraph cluster_" + id + " {\n    label=" + DotQuote(c == 0 ? "main map" : "part " + id) + "\n";
    for (const int index : component.submaps) {
      const SnapshotSubmap& submap = snapshot.submaps[index];
      dot += "    s" + std::to_string(submap.number) + " [label=" + DotQuote(std::to_string(submap.number)) +
             ", fillcolor=" + DotQuote(CategoryColor(submap.number)) +
             ", tooltip=" + DotQuote(SubmapName(submap) + ": " + std::to_string(submap.frames.size()) + " frames") +
             (submap.is_root ? ", penwidth=3" : "") + "]\n";
    }
    dot += "  }\n";
  }
  for (const GraphEdge& edge : ListEdges(snapshot)) {
    const EvaluatedConnection& c = *edge.connection;
    dot += "  s" + std::to_string(snapshot.submaps[edge.a].number) + " -- s" +
           std::to_string(snapshot.submaps[edge.b].number) + " [tooltip=" + DotQuote(c.reason);
    if (c.verdict == Verdict::kAccepted) {
      dot += ", label=\"" + EdgeLabel(c) + "\"";
      dot += c.in_tree ? ", style=bold, penwidth=3" : ", color=\"#6b7785\"";
    } else {
      dot += ", style=dashed, color=\"#b8c0c9\", constraint=false";
    }
    dot += "]\n";
  }
  return dot + "}\n";
}

}  // namespace mapmend

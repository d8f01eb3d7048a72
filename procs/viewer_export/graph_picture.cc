// MakeGraphSvg: the connection graph as a column of submaps with brackets beside it.

#include <algorithm>
#include <cstdio>
#include <map>
#include <utility>

#include "libs/drawing/svg_canvas.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/picture_colors.h"

namespace mapmend {
namespace {

using Eigen::Vector2d;
using Verdict = EvaluatedConnection::Verdict;

constexpr double kTop = 92, kRow = 64, kNodeX = 300, kRadius = 16;
constexpr double kLaneStart = 64, kWideLane = 84, kNarrowLane = 16;
constexpr double kLabelWidth = 150, kLabelHeight = 36;  // narrower than two lanes: it covers no other bracket
constexpr size_t kMostLabelledExtras =
    8;                                // accepted connections off the tree get a label while there are no more of them
constexpr size_t kMostRejected = 12;  // more rejected ones are only counted
constexpr char kExtra[] = "#8c97a3", kFaint[] = "#c3cad2";

struct Bracket {
  const GraphEdge* edge = nullptr;
  bool labelled = false;
  int lane = 0;
  int label_row = 0;  // the label stands below this row
  double x = 0;
  double y_a = 0, y_b = 0;  // where it leaves its submaps
};

double RowY(int row) { return kTop + kRow * row + kRow / 2; }

// A label's row: of those that the bracket spans the one nearest to its middle where neither its own lane nor those
// beside it have one; -1 if there is none.
int FindLabelRow(const Bracket& bracket, const std::vector<std::vector<const Bracket*>>& lanes, size_t lane) {
  const auto is_taken = [&](int row) {
    for (size_t l = lane > 0 ? lane - 1 : 0; l < std::min(lane + 2, lanes.size()); ++l) {
      if (std::any_of(lanes[l].begin(), lanes[l].end(), [&](const Bracket* b) { return b->label_row == row; })) {
        return true;
      }
    }
    return false;
  };
  const int a = bracket.edge->a, b = bracket.edge->b, middle = (a + b - 1) / 2;
  for (int away = 0; away < b - a; ++away) {
    for (const int row : {middle - away, middle + away}) {
      if (row >= a && row < b && !is_taken(row)) return row;
    }
  }
  return -1;
}

// Lanes from the inside out: shorter brackets first, each in the innermost lane that is free between its ends and, if
// it has a label, has room for that.
int AssignLanes(std::vector<Bracket*> brackets) {
  std::stable_sort(brackets.begin(), brackets.end(), [](const Bracket* p, const Bracket* q) {
    return std::make_pair(p->edge->b - p->edge->a, p->edge->a) < std::make_pair(q->edge->b - q->edge->a, q->edge->a);
  });
  std::vector<std::vector<const Bracket*>> lanes;
  for (Bracket* bracket : brackets) {
    size_t lane = 0;
    const auto meets = [&](const Bracket* other) {
      return bracket->edge->a < other->edge->b && other->edge->a < bracket->edge->b;
    };
    const auto fits = [&] {
      if (lane < lanes.size() && std::any_of(lanes[lane].begin(), lanes[lane].end(), meets)) return false;
      if (bracket->labelled) bracket->label_row = FindLabelRow(*bracket, lanes, lane);
      return bracket->label_row >= 0;
    };
    while (!fits()) ++lane;
    if (lane >= lanes.size()) lanes.resize(lane + 1);
    lanes[lane].push_back(bracket);
    bracket->lane = static_cast<int>(lane);
  }
  return static_cast<int>(lanes.size());
}

// Several brackets at one submap leave it at different heights: upwards ones above, downwards ones below, the inner
// first.
void AssignPorts(std::vector<Bracket>* brackets, int num_rows) {
  for (int row = 0; row < num_rows; ++row) {
    std::vector<std::pair<double, double*>> up, down;  // lane position, height to set
    for (Bracket& bracket : *brackets) {
      if (bracket.edge->b == row) up.emplace_back(bracket.x, &bracket.y_b);
      if (bracket.edge->a == row) down.emplace_back(bracket.x, &bracket.y_a);
    }
    const auto place = [&](std::vector<std::pair<double, double*>>& ports, double sign) {
      // The innermost bracket leaves furthest from the middle, so that it does not cross the outer ones.
      std::sort(ports.begin(), ports.end(), [](const auto& p, const auto& q) { return p.first > q.first; });
      const double spacing = ports.size() > 1 ? std::min(4.0, 9.0 / static_cast<double>(ports.size() - 1)) : 0;
      for (size_t i = 0; i < ports.size(); ++i)
        *ports[i].second = RowY(row) + sign * (3 + spacing * static_cast<double>(i));
    };
    place(up, -1);
    place(down, 1);
  }
}

std::string Describe(const Snapshot& snapshot, const GraphEdge& edge) {
  const EvaluatedConnection& c = *edge.connection;
  char text[160];
  std::snprintf(text, sizeof(text), "%d – %d: F %d, M %d, θ %.1f°, C %.1f, %d inliers. ",
                snapshot.submaps[edge.a].number, snapshot.submaps[edge.b].number, c.num_connected_frames,
                c.num_common_points, c.median_angle_deg, c.strength, c.num_inliers);
  return text + c.reason;
}

void DrawBracket(const Snapshot& snapshot, const Bracket& bracket, Canvas* canvas) {
  const EvaluatedConnection& c = *bracket.edge->connection;
  Canvas::Stroke stroke{kExtra, 1.5};
  if (c.in_tree) stroke = {"#1b7f4b", 4};
  if (c.verdict != Verdict::kAccepted) stroke = {c.verdict == Verdict::kDeactivated ? kRed : kFaint, 1.2, true};
  canvas->BeginGroup(Describe(snapshot, *bracket.edge));
  const double x0 = kNodeX + kRadius, r = std::min(8.0, 0.5 * (bracket.y_b - bracket.y_a));
  canvas->DrawPolyline({{x0, bracket.y_a},
                        {bracket.x - r, bracket.y_a},
                        {bracket.x - 0.3 * r, bracket.y_a + 0.3 * r},
                        {bracket.x, bracket.y_a + r},
                        {bracket.x, bracket.y_b - r},
                        {bracket.x - 0.3 * r, bracket.y_b - 0.3 * r},
                        {bracket.x - r, bracket.y_b},
                        {x0, bracket.y_b}},
                       stroke);
  canvas->EndGroup();
}

void DrawLabel(const Snapshot& snapshot, const Bracket& bracket, Canvas* canvas) {
  const EvaluatedConnection& c = *bracket.edge->connection;
  // Half-way between two rows, where no bracket turns.
  const Vector2d center(bracket.x, RowY(bracket.label_row) + kRow / 2);
  // One word has room in the label; the description has the other.
  const ConnectionKind kind = KindOf(c);
  std::string note;
  if (kind != ConnectionKind::kOrb) note = std::string(" · ") + ToString(kind);
  if (IsWeak(c) && kind != ConnectionKind::kMotion) note = " · weak";
  char first[64], second[96];
  std::snprintf(first, sizeof(first), "%d – %d · C %.1f%s", snapshot.submaps[bracket.edge->a].number,
                snapshot.submaps[bracket.edge->b].number, c.strength, note.c_str());
  std::snprintf(second, sizeof(second), "F %d · M %d · θ %.1f°", c.num_connected_frames, c.num_common_points,
                c.median_angle_deg);
  canvas->BeginGroup(Describe(snapshot, *bracket.edge));
  canvas->DrawRectangle(center - 0.5 * Vector2d(kLabelWidth, kLabelHeight), {kLabelWidth, kLabelHeight}, 6, "#ffffff",
                        {c.in_tree ? "#1b7f4b" : kFaint, c.in_tree ? 1.5 : 1.0});
  canvas->DrawText(center + Vector2d(0, -3), first, {12, kInk, Canvas::Anchor::kMiddle, true});
  canvas->DrawText(center + Vector2d(0, 12), second, {11, kMuted, Canvas::Anchor::kMiddle});
  canvas->EndGroup();
}

std::string ComponentName(const Snapshot& snapshot, int component) {
  if (component == 0) return snapshot.components.size() == 1 ? "" : "main map";
  return "part " + std::to_string(component);
}

void DrawSubmap(const Snapshot& snapshot, int row, Canvas* canvas) {
  const SnapshotSubmap& submap = snapshot.submaps[row];
  const Vector2d at(kNodeX, RowY(row));
  canvas->DrawText(at + Vector2d(-28, -3), SubmapName(submap), {13, kInk, Canvas::Anchor::kEnd, true});
  std::string counts = std::to_string(submap.frames.size()) + " frames, " +
                       std::to_string(submap.submap->keyframes.size()) + " keyframes";
  const std::string component = ComponentName(snapshot, submap.component);
  if (!component.empty()) counts += ", " + component;
  canvas->DrawText(at + Vector2d(-28, 13), counts, {11, kMuted, Canvas::Anchor::kEnd});
  canvas->DrawCircle(at, kRadius, CategoryColor(submap.number),
                     submap.is_root ? Canvas::Stroke{kInk, 2.5} : NoStroke());
  canvas->DrawText(at + Vector2d(0, 5), std::to_string(submap.number),
                   {13, InkOn(CategoryColor(submap.number)), Canvas::Anchor::kMiddle, true});
  if (row + 1 >= static_cast<int>(snapshot.submaps.size())) return;
  const Vector2d between = at + Vector2d(0, kRow / 2);
  if (submap.Lost()) {
    canvas->BeginGroup(submap.submap->end_detail.empty() ? ReadableReason(submap.submap->end_reason)
                                                         : submap.submap->end_detail);
    canvas->DrawPolyline({between + Vector2d(-5, -5), between + Vector2d(5, 5)}, {kRed, 2.5});
    canvas->DrawPolyline({between + Vector2d(-5, 5), between + Vector2d(5, -5)}, {kRed, 2.5});
    canvas->DrawText(between + Vector2d(-28, 4),
                     "lost after frame " + std::to_string(submap.submap->last_frame) + ": " +
                         ReadableReason(submap.submap->end_reason),
                     {11, kRed, Canvas::Anchor::kEnd});
    canvas->EndGroup();
  } else {
    canvas->DrawPolyline({between + Vector2d(-8, 0), between + Vector2d(8, 0)}, {kFaint, 1.5});
  }
}

struct GraphLayout {
  std::vector<Bracket> brackets;
  double width = 0;
  size_t num_hidden = 0;  // rejected ones not drawn
};

GraphLayout LayOut(const Snapshot& snapshot, const std::vector<GraphEdge>& edges) {
  GraphLayout layout;
  size_t num_extras = 0, num_rejected = 0;
  for (const GraphEdge& edge : edges) {
    const bool accepted = edge.connection->verdict == Verdict::kAccepted;
    num_extras += accepted && !edge.connection->in_tree;
    num_rejected += edge.connection->verdict == Verdict::kRejected;
  }
  for (const GraphEdge& edge : edges) {
    if (edge.connection->verdict == Verdict::kRejected && num_rejected > kMostRejected) {
      ++layout.num_hidden;
      continue;
    }
    const bool accepted = edge.connection->verdict == Verdict::kAccepted;
    layout.brackets.push_back({&edge, accepted && (edge.connection->in_tree || num_extras <= kMostLabelledExtras)});
  }
  std::vector<Bracket*> wide, narrow;
  for (Bracket& bracket : layout.brackets) (bracket.labelled ? wide : narrow).push_back(&bracket);
  const int num_wide = AssignLanes(wide), num_narrow = AssignLanes(narrow);
  // The unlabelled ones stay close to the submaps; the labelled ones stand outside, where there is room.
  const double wide_start = kNodeX + kLaneStart + kNarrowLane * num_narrow + kLabelWidth / 2;
  for (Bracket* bracket : narrow) bracket->x = kNodeX + kLaneStart - 20 + kNarrowLane * bracket->lane;
  for (Bracket* bracket : wide) bracket->x = wide_start - (num_narrow == 0 ? 20 : 0) + kWideLane * bracket->lane;
  layout.width = std::max(wide_start + kWideLane * (num_wide - 1) + kLabelWidth / 2 + 20, 720.0);
  AssignPorts(&layout.brackets, static_cast<int>(snapshot.submaps.size()));
  return layout;
}

void DrawKey(const GraphLayout& layout, Canvas* canvas) {
  double x = 20;
  const auto entry = [&](const std::string& text, const Canvas::Stroke& stroke) {
    canvas->DrawPolyline({{x, 66}, {x + 26, 66}}, stroke);
    if (!stroke.color.empty()) x += 32;
    canvas->DrawText({x, 70}, text, {11, kMuted});
    x += EstimateTextWidth(text, 11) + 18;
  };
  entry("in the tree", {"#1b7f4b", 4});
  entry("accepted, not needed", {kExtra, 1.5});
  if (layout.num_hidden == 0) {
    entry("rejected", {kFaint, 1.2, true});
  } else {
    entry(std::to_string(layout.num_hidden) + " rejected, not drawn", {"", 0});
  }
  entry("deactivated", {kRed, 1.2, true});
}

}  // namespace

std::string MakeGraphSvg(const Snapshot& snapshot) {
  const std::vector<GraphEdge> edges = ListEdges(snapshot);
  const GraphLayout layout = LayOut(snapshot, edges);
  const int num_rows = static_cast<int>(snapshot.submaps.size());
  SvgCanvas canvas(layout.width, kTop + kRow * std::max(num_rows, 1) + 16);
  canvas.DrawRectangle({0, 0}, {layout.width, kTop + kRow * std::max(num_rows, 1) + 16}, 0, "#ffffff", NoStroke());
  canvas.DrawText({20, 24}, "Connection graph", {17, kInk, Canvas::Anchor::kStart, true});
  canvas.DrawText({20, 44},
                  "F connected frames · M common points · θ angle between their rays · C = F + 0.1 M + 0.1 θ²",
                  {12, kMuted});
  if (num_rows == 0) canvas.DrawText({20, kTop + 20}, "No submap yet.", {13, kMuted});
  DrawKey(layout, &canvas);
  for (const Bracket& bracket : layout.brackets) {
    if (!bracket.edge->connection->in_tree) DrawBracket(snapshot, bracket, &canvas);
  }
  for (const Bracket& bracket : layout.brackets) {
    if (bracket.edge->connection->in_tree) DrawBracket(snapshot, bracket, &canvas);
  }
  for (const Bracket& bracket : layout.brackets) {
    if (bracket.labelled) DrawLabel(snapshot, bracket, &canvas);
  }
  for (int row = 0; row < num_rows; ++row) DrawSubmap(snapshot, row, &canvas);
  return canvas.Finish("Connection graph");
}

}  // namespace mapmend

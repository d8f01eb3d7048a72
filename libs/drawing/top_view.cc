#include "libs/drawing/top_view.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "libs/drawing/svg_canvas.h"

namespace mapmend {
namespace {

constexpr double kMargin = 20, kTitleHeight = 52, kTickSpace = 44, kRowHeight = 20;
constexpr double kLongSide = 760, kShortestSide = 300;
constexpr char kMuted[] = "#6b7785", kGrid[] = "#e8ecf0", kFrame[] = "#c5cdd6", kRed[] = "#d6212b";

// From view coordinates to pixels.
struct Layout {
  Eigen::Vector2d low, high;         // shown part of the plane
  Eigen::Vector2d top_left, extent;  // of the plot, pixels
  double scale = 1;                  // pixels per unit
  double legend_width = 0;
  Eigen::Vector2d size;

  Eigen::Vector2d ToPixel(const Eigen::Vector2d& p) const {
    return top_left + Eigen::Vector2d((p.x() - low.x()) * scale, (high.y() - p.y()) * scale);
  }
};

std::string ShortNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", std::abs(value) < 1e-9 ? 0.0 : value);
  return text;
}

Layout MakeLayout(const TopView& view) {
  Layout layout;
  bool any = false;
  const auto include = [&](const Eigen::Vector2d& p) {
    layout.low = any ? Eigen::Vector2d(layout.low.cwiseMin(p)) : p;
    layout.high = any ? Eigen::Vector2d(layout.high.cwiseMax(p)) : p;
    any = true;
  };
  double label_width = EstimateTextWidth(view.mark_label, 12);
  for (const TopViewTrack& track : view.tracks) {
    label_width = std::max(label_width, EstimateTextWidth(track.label, 12));
    for (const auto& piece : track.pieces) {
      for (const Eigen::Vector2d& p : piece) include(p);
    }
  }
  for (const TopViewMark& mark : view.marks) include(mark.at);
  for (const Eigen::Vector2d& p : view.here) include(p);
  if (!any) layout.low = layout.high = Eigen::Vector2d::Zero();
  Eigen::Vector2d span = layout.high - layout.low;
  const double longest = span.maxCoeff() > 0 ? span.maxCoeff() : 1.0;
  layout.scale = kLongSide / (1.12 * longest);
  // A margin all round, and never a sliver: a straight flight still gets some height.
  layout.extent = (span * layout.scale).array() + 0.12 * kLongSide / 1.12;
  layout.extent = layout.extent.cwiseMax(Eigen::Vector2d(kShortestSide, kShortestSide));
  const Eigen::Vector2d middle = 0.5 * (layout.low + layout.high);
  layout.low = middle - 0.5 * layout.extent / layout.scale;
  layout.high = middle + 0.5 * layout.extent / layout.scale;
  layout.top_left = {kMargin + kTickSpace, kTitleHeight};
  layout.legend_width = label_width + 44;
  const double rows = static_cast<double>(view.tracks.size()) + (view.marks.empty() ? 0 : 1);
  layout.size = {layout.top_left.x() + layout.extent.x() + 24 + layout.legend_width + kMargin,
                 kTitleHeight + std::max(layout.extent.y() + 34, rows * kRowHeight + 10) + kMargin};
  layout.size.x() = std::max(
      layout.size.x(), 2 * kMargin + std::max(EstimateTextWidth(view.title, 17), EstimateTextWidth(view.subtitle, 12)));
  return layout;
}

void DrawGrid(const TopView& view, const Layout& layout, Canvas* canvas) {
  canvas->DrawRectangle(layout.top_left, layout.extent, 0, "#fcfdfe", {kFrame, 1});
  const double step = RoundStep(110 / layout.scale);
  const Eigen::Vector2d bottom_right = layout.top_left + layout.extent;
  for (double x = std::ceil(layout.low.x() / step) * step; x <= layout.high.x(); x += step) {
    const double u = layout.ToPixel({x, 0}).x();
    canvas->DrawPolyline({{u, layout.top_left.y()}, {u, bottom_right.y()}}, {kGrid, 1});
    canvas->DrawText({u, bottom_right.y() + 16}, ShortNumber(x), {11, kMuted, Canvas::Anchor::kMiddle});
  }
  for (double y = std::ceil(layout.low.y() / step) * step; y <= layout.high.y(); y += step) {
    const double v = layout.ToPixel({0, y}).y();
    canvas->DrawPolyline({{layout.top_left.x(), v}, {bottom_right.x(), v}}, {kGrid, 1});
    canvas->DrawText({layout.top_left.x() - 6, v + 4}, ShortNumber(y), {11, kMuted, Canvas::Anchor::kEnd});
  }
  // The bar tells the size at a glance.
  const double bar = RoundStep(0.25 * layout.extent.x() / layout.scale);
  const Eigen::Vector2d at(layout.top_left.x() + 14, bottom_right.y() - 14);
  canvas->DrawPolyline({at + Eigen::Vector2d(0, -5), at, at + Eigen::Vector2d(bar * layout.scale, 0),
                        at + Eigen::Vector2d(bar * layout.scale, -5)},
                       {"#1f2933", 1.5});
  canvas->DrawText(at + Eigen::Vector2d(bar * layout.scale / 2, -6), ShortNumber(bar) + " " + view.unit,
                   {11, "#1f2933", Canvas::Anchor::kMiddle});
}

void DrawCross(const Eigen::Vector2d& at, Canvas* canvas) {
  for (const Canvas::Stroke& stroke : {Canvas::Stroke{"#ffffff", 5}, Canvas::Stroke{kRed, 2.5}}) {
    canvas->DrawPolyline({at + Eigen::Vector2d(-5, -5), at + Eigen::Vector2d(5, 5)}, stroke);
    canvas->DrawPolyline({at + Eigen::Vector2d(-5, 5), at + Eigen::Vector2d(5, -5)}, stroke);
  }
}

// An arrow head half-way along the longest piece shows the direction of flight.
void DrawDirection(const TopViewTrack& track, const Layout& layout, Canvas* canvas) {
  const std::vector<Eigen::Vector2d>* longest = nullptr;
  for (const auto& piece : track.pieces) {
    if (piece.size() >= 2 && (longest == nullptr || piece.size() > longest->size())) longest = &piece;
  }
  if (longest == nullptr) return;
  double length = 0;
  for (size_t i = 1; i < longest->size(); ++i) length += ((*longest)[i] - (*longest)[i - 1]).norm();
  double passed = 0;
  for (size_t i = 1; i < longest->size(); ++i) {
    const Eigen::Vector2d a = layout.ToPixel((*longest)[i - 1]), b = layout.ToPixel((*longest)[i]);
    const double step = ((*longest)[i] - (*longest)[i - 1]).norm();
    if (passed + step < length / 2 || step <= 0) {
      passed += step;
      continue;
    }
    const Eigen::Vector2d along = (b - a).normalized(), across(-along.y(), along.x());
    const Eigen::Vector2d tip = a + (b - a) * (length / 2 - passed) / step + 5 * along;
    canvas->DrawPolyline({tip - 9 * along + 5 * across, tip, tip - 9 * along - 5 * across}, {track.color, track.width});
    return;
  }
}

// Points closer than a pixel's fraction to the one before are left out: at 30 frames a second they only cost space.
std::vector<Eigen::Vector2d> ToPixels(const std::vector<Eigen::Vector2d>& piece, const Layout& layout) {
  std::vector<Eigen::Vector2d> pixels;
  for (size_t i = 0; i < piece.size(); ++i) {
    const Eigen::Vector2d pixel = layout.ToPixel(piece[i]);
    const bool last = i + 1 == piece.size();
    if (pixels.empty() || last || (pixel - pixels.back()).norm() >= 0.6) pixels.push_back(pixel);
  }
  return pixels;
}

void DrawTag(const TopViewTrack& track, const Layout& layout, Canvas* canvas) {
  if (track.tag.empty() || track.pieces.empty() || track.pieces.front().empty()) return;
  const Eigen::Vector2d at = layout.ToPixel(track.pieces.front().front());
  const double radius = std::max(9.0, 0.5 * EstimateTextWidth(track.tag, 11) + 4);
  canvas->DrawCircle(at, radius, track.color, {"#ffffff", 1.5});
  canvas->DrawText(at + Eigen::Vector2d(0, 4), track.tag, {11, "#ffffff", Canvas::Anchor::kMiddle, true});
}

void DrawLegend(const TopView& view, const Layout& layout, Canvas* canvas) {
  Eigen::Vector2d at(layout.top_left.x() + layout.extent.x() + 24, layout.top_left.y() + 12);
  for (const TopViewTrack& track : view.tracks) {
    canvas->BeginGroup(track.tooltip.empty() ? track.label : track.tooltip);
    canvas->DrawPolyline({at, at + Eigen::Vector2d(26, 0)}, {track.color, std::max(track.width, 1.5), track.dashed});
    canvas->DrawText(at + Eigen::Vector2d(34, 4), track.label, {12, "#1f2933"});
    canvas->EndGroup();
    at.y() += kRowHeight;
  }
  if (view.marks.empty()) return;
  DrawCross(at + Eigen::Vector2d(13, 0), canvas);
  canvas->DrawText(at + Eigen::Vector2d(34, 4), view.mark_label, {12, "#1f2933"});
}

}  // namespace

double RoundStep(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double mantissa = value / power;
  return power * (mantissa >= 5 ? 5 : mantissa >= 2 ? 2 : 1);
}

Eigen::Vector2d TopViewSize(const TopView& view) { return MakeLayout(view).size; }

void DrawTopView(const TopView& view, Canvas* canvas) {
  const Layout layout = MakeLayout(view);
  canvas->DrawRectangle({0, 0}, layout.size, 0, "#ffffff", NoStroke());
  canvas->DrawText({kMargin, 24}, view.title, {17, "#1f2933", Canvas::Anchor::kStart, true});
  canvas->DrawText({kMargin, 42}, view.subtitle, {12, kMuted});
  DrawGrid(view, layout, canvas);
  for (const TopViewTrack& track : view.tracks) {
    canvas->BeginGroup(track.tooltip.empty() ? track.label : track.tooltip);
    for (const auto& piece : track.pieces) {
      const std::vector<Eigen::Vector2d> pixels = ToPixels(piece, layout);
      if (pixels.size() == 1) canvas->DrawCircle(pixels[0], track.width, track.color, NoStroke());
      canvas->DrawPolyline(pixels, {track.color, track.width, track.dashed});
    }
    if (!track.tag.empty()) DrawDirection(track, layout, canvas);
    canvas->EndGroup();
  }
  for (const TopViewTrack& track : view.tracks) DrawTag(track, layout, canvas);
  for (const TopViewMark& mark : view.marks) {
    canvas->BeginGroup(mark.tooltip);
    DrawCross(layout.ToPixel(mark.at), canvas);
    canvas->EndGroup();
  }
  for (const Eigen::Vector2d& p : view.here) {
    canvas->DrawCircle(layout.ToPixel(p), 11, "", {"#1f2933", 1.5});
    canvas->DrawCircle(layout.ToPixel(p), 5.5, "#1f2933", {"#ffffff", 1.5});
  }
  DrawLegend(view, layout, canvas);
}

std::string TopViewSvg(const TopView& view) {
  const Eigen::Vector2d size = TopViewSize(view);
  SvgCanvas canvas(size.x(), size.y());
  DrawTopView(view, &canvas);
  return canvas.Finish(view.title);
}

}  // namespace mapmend

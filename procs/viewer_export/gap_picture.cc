#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/base/rounded.h"
#include "libs/base/text_format.h"
#include "libs/drawing/svg_canvas.h"
#include "libs/drawing/top_view.h"
#include "procs/viewer_export/gap_export.h"
#include "procs/viewer_export/picture_colors.h"

namespace mapmend {
namespace {

constexpr double kMargin = 20, kTitleHeight = 56, kLegendWidth = 190, kLongSide = 620;
constexpr int kMostRows = 220;  // of rectangles
constexpr const char* kSteps[] = {"#f6c9a0", "#f2e29b", "#cfe6b0", "#a5d6a0", "#74bf8b"};
constexpr const char* kStepNames[] = {"1 keyframe", "2 keyframes", "3 to 4", "5 to 8", "more than 8"};

int StepOf(int count) { return count <= 1 ? 0 : count == 2 ? 1 : count <= 4 ? 2 : count <= 8 ? 3 : 4; }

class GapPicture {
 public:
  GapPicture(const Snapshot& snapshot, const GapReport& report)
      : snapshot_(snapshot), report_(report), coverage_(report.coverage) {
    const auto [low, high] = Extent();
    corner_ = low;
    scale_ = kLongSide / std::max((high - low).maxCoeff(), 1e-9);
    size_ = scale_ * (high - low);
  }

  std::string Draw() {
    const double height = kTitleHeight + std::max(size_.y(), 300.0) + kMargin;
    SvgCanvas canvas(2 * kMargin + size_.x() + kLegendWidth, height);
    DrawTitle(&canvas);
    DrawCells(&canvas);
    DrawPaths(&canvas);
    DrawGaps(&canvas);
    DrawLegend(&canvas);
    return canvas.Finish("what to fly again");
  }

 private:
  // Of all that is drawn, with a little around it.
  std::pair<Eigen::Vector2d, Eigen::Vector2d> Extent() const {
    Eigen::Vector2d low = report_.footprints[0].camera.head<2>(), high = low;
    const auto add = [&](const Eigen::Vector3d& p) {
      low = low.cwiseMin(p.head<2>());
      high = high.cwiseMax(p.head<2>());
    };
    for (const Footprint& footprint : report_.footprints)
      std::for_each(footprint.corners.begin(), footprint.corners.end(), add);
    for (const Gap& gap : report_.gaps) std::for_each(gap.line.begin(), gap.line.end(), add);
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(2 * coverage_.cell);
    return {low - margin, high + margin};
  }
  Eigen::Vector2d At(const Eigen::Vector2d& ground) const {
    const Eigen::Vector2d pixel = scale_ * (ground - corner_);
    return {kMargin + pixel.x(), kTitleHeight + size_.y() - pixel.y()};
  }

  void DrawTitle(Canvas* canvas) const {
    double again = 0;
    for (const CoverageRegion& region : coverage_.regions) again += region.area;
    const char* square = report_.is_placed ? "m²" : "square map units";
    canvas->DrawText({kMargin, 24}, "What to fly again", {17, "#1f2933", Canvas::Anchor::kStart, true});
    canvas->DrawText({kMargin, 43},
                     "ground seen: " + Rounded(coverage_.area_seen) + " " + square +
                         "; seen by too few images inside the area: " + Rounded(again) + " " + square,
                     {12, kMuted});
  }

  // Runs of cells of one colour.
  void DrawCells(Canvas* canvas) const {
    const int step = std::max(1, (std::max(coverage_.width, coverage_.height) + kMostRows - 1) / kMostRows);
    const double side = scale_ * coverage_.cell * step;
    for (int y = 0; y < coverage_.height; y += step) {
      for (int x = 0; x < coverage_.width;) {
        const int count = coverage_.Count(x, y);
        int end = x;
        while (end < coverage_.width && Color(coverage_.Count(end, y)) == Color(count)) end += step;
        if (count > 0) {
          const Eigen::Vector2d low = At(coverage_.corner + coverage_.cell * Eigen::Vector2d(x, y));
          canvas->DrawRectangle({low.x(), low.y() - side}, {scale_ * coverage_.cell * (end - x) + 0.3, side + 0.3}, 0,
                                kSteps[StepOf(count)], NoStroke());
        }
        x = end;
      }
    }
  }
  static int Color(int count) { return count == 0 ? -1 : StepOf(count); }

  void DrawPaths(Canvas* canvas) const {
    for (const int c : report_.components) {
      for (const int index : snapshot_.components[c].submaps) {
        const SnapshotSubmap& submap = snapshot_.submaps[index];
        Trajectory level;
        for (const StampedPose& pose : ToTrajectory(submap.frames))
          level.push_back({pose.utime, Rigid3(pose.world_from_camera.rotation,
                                              report_.level_from_world * pose.world_from_camera.translation)});
        for (const auto& piece : ProjectPieces(level, PlaneView())) {
          std::vector<Eigen::Vector2d> points;
          points.reserve(piece.size());
          for (const Eigen::Vector2d& p : piece) points.push_back(At(p));
          canvas->DrawPolyline(points, {CategoryColor(submap.number), 1.5, false});
        }
      }
    }
  }

  void DrawGaps(Canvas* canvas) const {
    for (const Gap& gap : report_.gaps) {
      canvas->BeginGroup(gap.text);
      for (const std::vector<Eigen::Vector2d>& ring : gap.region.rings) {
        std::vector<Eigen::Vector2d> points;
        for (size_t i = 0; i <= ring.size(); ++i) points.push_back(At(ring[i % ring.size()]));
        canvas->DrawPolyline(points, {kRed, 1.5, false});
      }
      std::vector<Eigen::Vector2d> points;
      for (const Eigen::Vector3d& p : gap.line) points.push_back(At(p.head<2>()));
      if (points.size() > 1)
        canvas->DrawPolyline(points,
                             {kRed, gap.kind == Gap::Kind::kConnection ? 3.5 : 2.5, gap.kind == Gap::Kind::kStretch});
      canvas->EndGroup();
    }
  }

  void DrawLegend(Canvas* canvas) const {
    const double x = kMargin + size_.x() + 16;
    double y = kTitleHeight + 10;
    canvas->DrawText({x, y}, "seen by", {12, kMuted});
    for (size_t i = 0; i < std::size(kSteps); ++i) {
      y += 20;
      canvas->DrawRectangle({x, y - 10}, {14, 12}, 2, kSteps[i], NoStroke());
      canvas->DrawText({x + 22, y}, kStepNames[i], {12, "#1f2933"});
    }
    const auto line = [&](const char* text, double width, bool dashed) {
      y += 24;
      canvas->DrawPolyline({{x, y - 4}, {x + 16, y - 4}}, {kRed, width, dashed});
      canvas->DrawText({x + 22, y}, text, {12, "#1f2933"});
    };
    line("too few images", 1.5, false);
    line("flown, no map", 2.5, true);
    line("would join two parts", 3.5, false);
    const double length = RoundStep(0.3 * size_.x() / scale_);
    y += 40;
    canvas->DrawPolyline({{x, y}, {x + scale_ * length, y}}, {"#1f2933", 2, false});
    canvas->DrawText({x, y + 16}, Format("%g %s", length, report_.Unit()), {12, "#1f2933"});
    if (report_.is_placed) canvas->DrawText({x, y + 34}, "north is up", {12, kMuted});
  }

  const Snapshot& snapshot_;
  const GapReport& report_;
  const Coverage& coverage_;
  double scale_ = 1;               // pixels per unit
  Eigen::Vector2d corner_, size_;  // what is drawn: ground, least x and y; pixels
};

}  // namespace

std::string MakeGapsSvg(const Snapshot& placed, const GapReport& report) {
  if (!report.has_ground || report.coverage.counts.empty()) return "";
  return GapPicture(placed, report).Draw();
}

}  // namespace mapmend

#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace mapmend {

// What a picture is drawn on: SVG for reports (svg_canvas.h), pixels where a bitmap is wanted. Coordinates are pixels,
// origin at the top left, y down. Colours are "#rrggbb"; an empty colour draws nothing.
class Canvas {
 public:
  struct Stroke {
    std::string color = "#000000";
    double width = 1;
    bool dashed = false;
  };
  enum class Anchor { kStart, kMiddle, kEnd };
  struct Font {
    double size = 12;
    std::string color = "#1f2933";
    Anchor anchor = Anchor::kStart;
    bool bold = false;
  };

  virtual ~Canvas() = default;
  virtual void DrawPolyline(const std::vector<Eigen::Vector2d>& points, const Stroke& stroke) = 0;
  virtual void DrawCircle(const Eigen::Vector2d& center, double radius, const std::string& fill,
                          const Stroke& stroke) = 0;
  // corner_radius rounds the corners where the canvas can.
  virtual void DrawRectangle(const Eigen::Vector2d& top_left, const Eigen::Vector2d& size, double corner_radius,
                             const std::string& fill, const Stroke& stroke) = 0;
  // at: the base line's start, middle or end. text: UTF-8.
  virtual void DrawText(const Eigen::Vector2d& at, const std::string& text, const Font& font) = 0;
  // What is drawn between the two belongs together and shows this text when pointed at, where the canvas can.
  virtual void BeginGroup(const std::string& tooltip) = 0;
  virtual void EndGroup() = 0;
};

// No outline.
inline Canvas::Stroke NoStroke() { return {"", 0, false}; }

// A colour that tells number index from its neighbours: nine that people who do not see red, green or blue can tell
// apart (after M. Okabe, K. Ito, "Color Universal Design", 2008), then hues around the circle.
std::string CategoryColor(int index);
// Black or white, whichever can be read better on a colour, "#rrggbb".
std::string InkOn(const std::string& color);

// Width of a text in the canvas's sans-serif font, pixels, good to some 10 %.
double EstimateTextWidth(const std::string& text, double font_size);

}  // namespace mapmend

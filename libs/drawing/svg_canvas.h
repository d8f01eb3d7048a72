#pragma once

#include <string>
#include <vector>

#include "libs/drawing/canvas.h"

namespace mapmend {

// Draws into SVG 1.1 text, which can stand as a file or inside an HTML page. The output depends on the calls only.
class SvgCanvas : public Canvas {
 public:
  SvgCanvas(double width, double height);

  void DrawPolyline(const std::vector<Eigen::Vector2d>& points, const Stroke& stroke) override;
  void DrawCircle(const Eigen::Vector2d& center, double radius, const std::string& fill, const Stroke& stroke) override;
  void DrawRectangle(const Eigen::Vector2d& top_left, const Eigen::Vector2d& size, double corner_radius,
                     const std::string& fill, const Stroke& stroke) override;
  void DrawText(const Eigen::Vector2d& at, const std::string& text, const Font& font) override;
  void BeginGroup(const std::string& tooltip) override;
  void EndGroup() override;

  // The whole document. title is what a screen reader says.
  std::string Finish(const std::string& title) const;

 private:
  double width_, height_;
  std::string body_;
};

// Text with & < > " ' replaced, for XML and HTML; control characters become spaces.
std::string EscapeXml(const std::string& text);

}  // namespace mapmend

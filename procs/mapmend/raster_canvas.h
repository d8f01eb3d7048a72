#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libs/drawing/canvas.h"

namespace mapmend {

// Draws into a bitmap of twice the size in pixels, for sharp lines. Dashes are drawn solid and thin; tooltips do not
// exist.
class RasterCanvas : public Canvas {
 public:
  RasterCanvas(double width, double height);
  ~RasterCanvas() override;

  void DrawPolyline(const std::vector<Eigen::Vector2d>& points, const Stroke& stroke) override;
  void DrawCircle(const Eigen::Vector2d& center, double radius, const std::string& fill, const Stroke& stroke) override;
  void DrawRectangle(const Eigen::Vector2d& top_left, const Eigen::Vector2d& size, double corner_radius,
                     const std::string& fill, const Stroke& stroke) override;
  void DrawText(const Eigen::Vector2d& at, const std::string& text, const Font& font) override;
  void BeginGroup(const std::string& tooltip) override;
  void EndGroup() override;

  // The picture as the bytes of a PNG file.
  std::string EncodePng() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend

#pragma once

#include <functional>
#include <memory>

#include "tools/simulate/material.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// A picture painted in metres, origin in the upper left corner, y down: a wall, a facade, a floor.
class Canvas {
 public:
  Canvas(double width, double height, double texels_per_metre)
      : scale_(texels_per_metre),
        image_(std::max(2, static_cast<int>(width * texels_per_metre)),
               std::max(2, static_cast<int>(height * texels_per_metre))) {}

  double Width() const { return image_.width / scale_; }
  double Height() const { return image_.height / scale_; }
  double Scale() const { return scale_; }
  // paint(x, y, what is there) for every texel of the rectangle.
  void Fill(double x, double y, double width, double height,
            const std::function<Color(double, double, const Color&)>& paint);
  void Rect(double x, double y, double width, double height, const Color& color);
  // Rows of short dark bars, as print looks from afar.
  void Print(double x, double y, double width, double height, double line, const Color& ink, Random* random);
  // One of the twelve photographs, number 0 to 11, or a part of it, with a frame.
  void Photo(double x, double y, double width, double height, const Image& photos, Random* random);

  std::shared_ptr<const Texture> Finish() { return std::make_shared<Texture>(std::move(image_)); }

 private:
  double scale_;
  Image image_;
};

// Adds a box with a texture of its own on its four sides (painted by paint_side, called with canvas and side) and plain
// or textured top.
//   center: of the box; sides are 0: +x, 1: -x, 2: +y, 3: -y; a side whose paint returns false keeps the plain colour
struct BoxPaint {
  double texels_per_metre = 100;
  Color plain = Rgb(200, 200, 200);
  std::function<bool(int side, Canvas*)> side;
  std::function<bool(Canvas*)> top, bottom;  // empty: plain
};
void AddPaintedBox(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw,
                   const BoxPaint& paint);

// A random colour, mostly muted, as things are.
Color MutedColor(Random* random, double low, double high);

// Light on an inner or outer surface by its orientation, about 1.
float AmbientLight(const Eigen::Vector3d& normal);

}  // namespace mapmend::simulate

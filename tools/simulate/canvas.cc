#include "tools/simulate/canvas.h"

#include <Eigen/Geometry>

namespace mapmend::simulate {

void Canvas::Fill(double x, double y, double width, double height,
                  const std::function<Color(double, double, const Color&)>& paint) {
  const int x0 = std::max(0, static_cast<int>(std::lround(x * scale_))),
            x1 = std::min(image_.width, static_cast<int>(std::lround((x + width) * scale_)));
  const int y0 = std::max(0, static_cast<int>(std::lround(y * scale_))),
            y1 = std::min(image_.height, static_cast<int>(std::lround((y + height) * scale_)));
  for (int j = y0; j < y1; ++j) {
    for (int i = x0; i < x1; ++i)
      image_.At(i, j) = Pack(paint((i + 0.5) / scale_, (j + 0.5) / scale_, Unpack(image_.At(i, j))));
  }
}

void Canvas::Rect(double x, double y, double width, double height, const Color& color) {
  Fill(x, y, width, height, [&](double, double, const Color&) { return color; });
}

void Canvas::Print(double x, double y, double width, double height, double line, const Color& ink, Random* random) {
  for (double row = y + 0.4 * line; row + 0.5 * line < y + height; row += line) {
    for (double at = x + 0.5 * line; at < x + width - line;) {
      const double word = std::min(line * random->Uniform(0.8, 4), x + width - 0.5 * line - at);
      for (double letter = at; letter < at + word; letter += 0.42 * line) {
        const double tall = random->Uniform() < 0.3 ? 0.62 * line : 0.42 * line;
        Rect(letter, row + 0.62 * line - tall, 0.28 * line, tall, ink);
      }
      at += word + 0.5 * line;
      if (random->Uniform() < 0.07) break;
    }
  }
}

void Canvas::Photo(double x, double y, double width, double height, const Image& photos, Random* random) {
  const int tile_w = photos.width / 4, tile_h = photos.height / 3;
  const int column = random->Int(4), row = random->Int(3);
  const double zoom = random->Uniform(0.4, 1), left = random->Uniform(0, 1 - zoom), top = random->Uniform(0, 1 - zoom);
  const Color tint = Rgb(random->Uniform(0.75, 1.2), random->Uniform(0.75, 1.2), random->Uniform(0.75, 1.2));
  const bool mirrored = random->Int(2) == 1;
  Fill(x, y, width, height, [&](double px, double py, const Color&) {
    double u = (px - x) / width;
    const double v = (py - y) / height;
    if (mirrored) u = 1 - u;
    return photos.Bilinear(static_cast<float>((column + left + zoom * u) * tile_w),
                           static_cast<float>((row + top + zoom * v) * tile_h)) *
           tint;
  });
  const double frame = random->Int(2) == 0 ? 0.015 : 0;
  if (frame == 0) return;
  const Color color = random->Int(2) == 0 ? Rgb(40, 34, 30) : Rgb(235, 235, 230);
  Rect(x, y, width, frame, color);
  Rect(x, y + height - frame, width, frame, color);
  Rect(x, y, frame, height, color);
  Rect(x + width - frame, y, frame, height, color);
}

Color MutedColor(Random* random, double low, double high) {
  const Color color = Rgb(random->Uniform(low, high), random->Uniform(low, high), random->Uniform(low, high));
  const float grey = Luminance(color) * static_cast<float>(random->Uniform(0.9, 1.1));
  const double vivid = random->Uniform();
  return color + (Rgb(grey * 1.03, grey, grey * 0.95) - color) * static_cast<float>(1 - 0.75 * vivid * vivid * vivid);
}

float AmbientLight(const Eigen::Vector3d& normal) {
  return static_cast<float>(0.92 + 0.07 * normal.x() + 0.04 * normal.y() + 0.06 * normal.z());
}

void AddPaintedBox(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw,
                   const BoxPaint& paint) {
  Solid solid = MakeBox(center, size, yaw);
  const Eigen::Vector3d x(std::cos(yaw), std::sin(yaw), 0), y(-x.y(), x.x(), 0), z = Eigen::Vector3d::UnitZ();
  for (int f = 0; f < 6; ++f) {
    Face& face = solid.faces[f];
    const float light = AmbientLight(face.normal);
    face.color = paint.plain * light;
    // Seen from outside: u to the right, v down. Top and bottom: u along x.
    const Eigen::Vector3d v = f < 4 ? Eigen::Vector3d(-z) : Eigen::Vector3d(-y),
                          u = f < 4 ? Eigen::Vector3d(z.cross(face.normal)) : x;
    const double width = f < 2 ? size.y() : size.x(), height = f < 4 ? size.z() : size.y();
    Canvas canvas(width, height, paint.texels_per_metre);
    const bool painted = f < 4    ? paint.side && paint.side(f, &canvas)
                         : f == 4 ? paint.top && paint.top(&canvas)
                                  : paint.bottom && paint.bottom(&canvas);
    if (!painted) continue;
    const double depth = f < 2 ? size.x() : f < 4 ? size.y() : size.z();
    const Eigen::Vector3d corner = center + face.normal * depth / 2 - u * width / 2 - v * height / 2;
    LayTexture(&face, static_cast<int>(scene->textures.size()), corner, u, v, paint.texels_per_metre);
    face.color = Color{light, light, light, 1};
    scene->textures.push_back(canvas.Finish());
  }
  scene->solids.push_back(std::move(solid));
}

}  // namespace mapmend::simulate

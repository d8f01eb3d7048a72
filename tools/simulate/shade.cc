// Colour of what a ray has hit: filtered texture lookups. Light is part of the textures and of the faces' colours.
#include "tools/simulate/scene.h"

namespace mapmend::simulate {
namespace {

// Samples along the long axis of a pixel's footprint: width texels across, (step_x, step_y) texels long.
Color SampleFootprint(const Texture& texture, float x, float y, float step_x, float step_y, float width) {
  const float length = std::sqrt(step_x * step_x + step_y * step_y);
  const float lod = Log2(std::max(width, 1e-6f));
  if (length < 1.6f * width || length < 1) return texture.Sample(x, y, lod);
  const int taps = std::min(6, static_cast<int>(std::ceil(length / width)));
  const float inverse = 1.f / static_cast<float>(taps);
  // With too few taps for the length each must cover more.
  const float tap_lod = Log2(std::max(width, length * inverse));
  Color sum = {};
  for (int i = 0; i < taps; ++i) {
    const float f = (static_cast<float>(i) + 0.5f) * inverse - 0.5f;
    sum += texture.Sample(x + f * step_x, y + f * step_y, tap_lod);
  }
  return sum * inverse;
}

}  // namespace

DetailLook Scene::Detail(double u, double v) const {
  return {detail.get(), detail->LastWhole(), ground_detail * (1.f / 128), u, v};
}

Color Scene::ShadeGround(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double footprint, double slope,
                         double time) const {
  const double scale = ground_texels_per_metre;
  const double x = (point.x() - grid.x0) * scale - 0.5, y = (point.y() - grid.y0) * scale - 0.5;
  const double stretch = 1.0 / std::max(0.08, -direction.z());
  const double width = footprint * scale;
  const double horizontal = std::sqrt(std::max(1e-12, 1 - direction.z() * direction.z()));
  const double length = width * stretch / horizontal;
  // Seen from above a steep side, of a tree say, has few texels: blur their streaks away and let the detail replace
  // them.
  const double steep = std::max(1.0, 0.8 * slope);
  Color color = SampleFootprint(*ground, static_cast<float>(x), static_cast<float>(y),
                                static_cast<float>(length * direction.x()), static_cast<float>(length * direction.y()),
                                static_cast<float>(std::max(width, steep > 1 ? 1.5 * steep : 0)));
  if (foliage > 0 && color[3] > 1) {
    // On steep sides, of trees, a grid seen from above would show as streaks: there each layer of height is of its own.
    const double up = slope > 0.7 ? scale * point.z() : 0;
    const double turns = ground_repeat > 0 ? std::floor(x / ground_repeat) : 0;
    const float leaves =
        Canopy(x - turns * ground_repeat, y, up, Log2(static_cast<float>(width)), LeavesSeen(direction, time));
    color *= 1.f + foliage * (1.f / 255) * color[3] * leaves;
  }
  if (detail == nullptr) return color;
  if (steep > 1 && foliage <= 0) {
    const int size = detail->Width();
    const auto wrap = [size](double v) { return static_cast<float>(v - std::floor(v / size) * size); };
    const float grey = detail->Sample(wrap(x + 0.7 * scale * point.z()), wrap(y + 0.9 * scale * point.z()),
                                      Log2(static_cast<float>(width)))[0];
    color *= 1.f + 2.5f * ground_detail * static_cast<float>(std::min(1.0, steep - 1)) * (grey - 128.f) * (1.f / 128);
  }
  double copy = DetailLook::kFirst;
  for (int i = 0; i < DetailLook::kCopies; ++i, copy *= DetailLook::kGrowth) {
    const double weight = 1 - DetailLook::kFading * width * copy;
    if (weight <= 0) break;
    const int size = detail->Width();
    const auto wrap = [size](double v) { return static_cast<float>(v - std::floor(v / size) * size); };
    const float lod = Log2(static_cast<float>(std::max(width * copy, 1e-6)));
    const float grey = detail->Sample(wrap(copy * (0.8 * x + 0.6 * y)), wrap(copy * (0.8 * y - 0.6 * x)), lod)[0];
    color *= 1.f + ground_detail * static_cast<float>(weight) * (grey - 128.f) * (1.f / 128);
  }
  return color;
}

Color Scene::Shade(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Hit& hit, double pixel_angle,
                   double time) const {
  if (hit.surface == Hit::kNothing) {
    if (continues && direction.z() < -0.02 && origin.z() > 0) {
      const double distance = -origin.z() / direction.z(), scale = ground_texels_per_metre;
      // Back and forth between the borders.
      const auto mirror = [](double at, int size) {
        const double turn = at - 2.0 * size * std::floor(at / (2.0 * size));
        return static_cast<float>(turn < size ? turn : 2.0 * size - turn);
      };
      const double width = distance * pixel_angle * scale, length = width / -direction.z();
      const Color land =
          SampleFootprint(*ground, mirror((origin.x() + distance * direction.x() - grid.x0) * scale, ground->Width()),
                          mirror((origin.y() + distance * direction.y() - grid.y0) * scale, ground->Height()),
                          static_cast<float>(length * direction.x()), static_cast<float>(length * direction.y()),
                          static_cast<float>(width));
      return land + (sky_low - land) * static_cast<float>(distance / (distance + 1500));
    }
    const float up = static_cast<float>(std::clamp(direction.z() * 1.5, 0.0, 1.0));
    return sky_low + (sky_high - sky_low) * up;
  }
  const Eigen::Vector3d point = origin + hit.distance * direction;
  const double footprint = hit.distance * pixel_angle;
  if (hit.surface == Hit::kGround) return ShadeGround(point, direction, footprint, hit.slope, time);
  const Face& face = solids[(hit.surface - 1) / 8].faces[(hit.surface - 1) % 8];
  if (face.texture < 0) return face.color;
  const double cosine = std::max(0.08, -face.normal.dot(direction));
  const Eigen::Vector3d along = direction + face.normal * -face.normal.dot(direction);
  const double sine = std::max(1e-6, along.norm());
  const double width = footprint * face.texels_per_metre, length = footprint / (cosine * sine);
  const Color texel =
      SampleFootprint(*textures[face.texture], static_cast<float>(face.u.dot(point) + face.u0),
                      static_cast<float>(face.v.dot(point) + face.v0), static_cast<float>(length * face.u.dot(along)),
                      static_cast<float>(length * face.v.dot(along)), static_cast<float>(width));
  return texel * face.color;
}

}  // namespace mapmend::simulate

// The colours of the ground seen from above, without light.
#include "tools/simulate/aerial.h"

namespace mapmend::simulate {
namespace {

// Photographs are about 0.15 m a pixel; here their pixels are taken as this many metres, so that grass is fine enough
// for lower flights.
constexpr double kPhotoTexel = 0.12;

Color Blend(const Color& a, const Color& b, double weight) {
  return a + (b - a) * static_cast<float>(std::clamp(weight, 0.0, 1.0));
}

double Smooth(double low, double high, double v) {
  const double t = std::clamp((v - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

constexpr double kLawnLeaves = 0.2, kCropLeaves = 0.13, kMarshLeaves = 0.7, kTreeLeaves = 0.8;

// Alpha: how much of the place is leaves and blades.
Color Leafy(Color color, double share) {
  color[3] = static_cast<float>(255 * share);
  return color;
}

// Less of its colour, the same brightness: the photographs show the greenest lawn and bush of their flight.
Color Faded(const Color& color, float saturation) {
  const float grey = Luminance(color);
  Color faded = color;
  for (int i = 0; i < 3; ++i) faded[i] = grey + saturation * (color[i] - grey);
  return faded;
}

// Slow changes of brightness and of the balance of green and red, as in any meadow.
Color Tint(double x, double y, double amount, uint64_t seed) {
  const double light = Fbm(x / 9, y / 9, 4, 0.6, seed), hue = Fbm(x / 31, y / 31, 3, 0.6, seed + 1);
  const auto tint = [&](double h) { return static_cast<float>(1 + amount * (light + 0.5 * h * hue)); };
  return Color{tint(0.7), tint(-0.2), tint(0.3), 1};
}

class Ground {
 public:
  Ground(const AerialLayout& layout, const MaterialLibrary& materials, double x, double y)
      : layout_(layout), materials_(materials), x_(x), y_(y), seed_(layout.Options().seed) {}

  Color At(const Material& material, int salt, double scale = 1) const {
    return material.At(x_ / (kPhotoTexel * scale), y_ / (kPhotoTexel * scale),
                       Hash(seed_, static_cast<uint64_t>(salt)));
  }
  Color Park() const {
    const double dry = Smooth(-0.25, 0.35, Fbm(x_ / 45, y_ / 45, 4, 0.5, seed_ + 11));
    const double lush = Smooth(0.1, 0.5, Fbm(x_ / 25, y_ / 25, 4, 0.5, seed_ + 12));
    const double worn = Smooth(0.28, 0.4, Fbm(x_ / 14, y_ / 14, 5, 0.6, seed_ + 13));
    Color color = Blend(Blend(At(materials_.lawn, 1), At(materials_.meadow, 2), lush), At(materials_.dry_lawn, 3), dry);
    color = Faded(Blend(color, At(materials_.dry_lawn, 4) * Color{1.08f, 0.96f, 0.92f, 1}, worn), 0.85f);
    return Leafy(color * Tint(x_, y_, 0.16, seed_ + 14), kLawnLeaves * (1 + 0.6 * lush - 0.4 * worn));
  }
  Color Marsh() const {
    const double wet = Fbm(x_ / 38, y_ / 38, 5, 0.55, seed_ + 15);
    const Color reed = At(materials_.marsh, 5) * Tint(x_, y_, 0.14, seed_ + 16);
    const Color green = At(materials_.bush, 6) * Tint(x_, y_, 0.2, seed_ + 17);
    return Leafy(Blend(reed, green, Smooth(0.02, 0.08, wet)), kMarshLeaves);
  }
  Color Forest() const {
    const Color floor = At(materials_.marsh, 7) * Color{0.62f, 0.62f, 0.5f, 1};
    return Leafy(
        Blend(floor, At(materials_.bush, 8) * 0.8f, Smooth(-0.1, 0.1, Fbm(x_ / 12, y_ / 12, 5, 0.6, seed_ + 18))),
        kMarshLeaves);
  }
  // Strips of crops, each ploughed along its own direction, with ridges between them.
  Color Fields(const AerialLayout::Place& place) const {
    const double size = layout_.Options().road_spacing;
    Random random(place.seed + 3);
    const double turn = random.Uniform(-0.5, 0.5) + (random.Int(2) == 0 ? 0.0 : 1.5707963267948966);
    const double lu = place.u - (static_cast<double>(place.block_x) + 0.5) * size,
                 lv = place.v - (static_cast<double>(place.block_y) + 0.5) * size;
    const double a = std::cos(turn) * lu - std::sin(turn) * lv + 2.5 * Fbm(x_ / 30, y_ / 30, 3, 0.5, seed_ + 19);
    const double b = std::sin(turn) * lu + std::cos(turn) * lv + 2.5 * Fbm(x_ / 30, y_ / 30, 3, 0.5, seed_ + 20);
    // Borders of strips are random: walk until the one that holds a.
    double low = -size, high = low;
    uint64_t strip = 0;
    while (high <= a) {
      low = high;
      ++strip;
      high = low + 9 + 22 * Unit(Hash(place.seed, strip));
    }
    double start = -size, end = start;
    uint64_t plot = 0;
    while (end <= b) {
      start = end;
      ++plot;
      end = start + 14 + 40 * Unit(Hash(place.seed + strip, plot, 5));
    }
    const uint64_t field = Hash(place.seed, strip, plot);
    const double kind = Unit(Hash(field)), row = 0.7 + 1.2 * Unit(Hash(field, 1));
    Color color = {};
    if (kind < 0.4) {
      color = Blend(At(materials_.dry_lawn, 9), At(materials_.marsh, 10), 0.7) * Color{0.94f, 0.88f, 0.86f, 1};
    } else if (kind < 0.6) {
      color = At(materials_.marsh, 11) * Color{1.05f, 0.98f, 0.9f, 1};
    } else if (kind < 0.8) {
      color = Blend(At(materials_.dry_lawn, 12), At(materials_.meadow, 13), 0.6);
    } else {
      color = Blend(At(materials_.meadow, 14), At(materials_.bush, 15), 0.5) * Color{0.72f, 0.86f, 0.8f, 1};
    }
    const bool lengthwise = Unit(Hash(field, 2)) < 0.7;
    const double along = (lengthwise ? a : b) + 0.35 * Fbm(x_ / 6, y_ / 6, 3, 0.5, field);
    const double furrow = along / row - std::floor(along / row);
    const double broken = Smooth(-0.3, 0.2, Fbm(x_ / 5, y_ / 5, 3, 0.6, field + 1));
    const double contrast = (0.06 + 0.16 * Unit(Hash(field, 3))) * broken;
    color *= static_cast<float>(1 + contrast * (furrow < 0.45 ? -1 : 0.8));
    const double shade = 0.82 + 0.34 * Unit(Hash(field, 4));
    const double ridge = std::min({a - low, high - a, b - start, end - b});
    color = color * static_cast<float>(shade) * Tint(x_, y_, 0.13, field);
    color = Leafy(color, kind < 0.6 ? kCropLeaves : 1.6 * kCropLeaves);
    if (ridge < 0.5)
      color = Blend(color, At(materials_.meadow, 16) * (Unit(Hash(field, 6)) < 0.5 ? 0.7f : 1.05f), 0.85);
    return color;
  }
  // Each road is of its own kind: asphalt with a pavement, asphalt with a ragged edge, or gravel with a grass strip.
  Color Road(const AerialLayout::Place& place) const {
    Random random(place.road_seed);
    const double kind = random.Uniform(), half = random.Uniform(2.4, 3.2), tone = random.Uniform(0.72, 1.18);
    const double ragged = 0.5 * Fbm(x_ / 1.7, y_ / 1.7, 4, 0.65, seed_ + 25), road = place.road + ragged;
    const double patch = Fbm(x_ / 11, y_ / 11, 4, 0.6, seed_ + 26);
    const auto worn = static_cast<float>(tone * (1 + 0.1 * patch));
    if (kind > 0.7) {
      const Color gravel = Blend(Concrete(x_ + 0.31 * y_, y_, seed_ + 27), At(materials_.dry_lawn, 17), 0.55) *
                           Color{0.98f, 0.9f, 0.8f, 1} * worn;
      const Color grass = Park();
      return Blend(Blend(gravel, grass, Smooth(half - 0.7, half, road)), grass, Smooth(0.5, 0.15, road + 0.3 * patch));
    }
    const Color base = Asphalt(x_, y_, seed_ + 21) * worn;
    if (place.road > half && kind < 0.35 && place.road < 4.4) {
      return place.road < half + 0.2
                 ? Concrete(x_, y_, seed_) * 0.95f
                 : Concrete(place.road, place.along, seed_ + 1) * static_cast<float>(0.8 + 0.2 * tone);
    }
    if (road > half) return Blend(base, Park(), Smooth(half, half + 0.4, road));
    const Color paint = Rgb(215, 213, 200);
    const double flaked = Fbm(x_ / 0.8, y_ / 0.8, 3, 0.6, seed_ + 22) + random.Uniform(-0.5, 0.3) > -0.2 ? 0.65 : 0.1;
    const double dash = place.along / 9 - std::floor(place.along / 9);
    const bool lines = random.Uniform() < 0.6;
    if (lines && !place.crossing && ((place.road < 0.08 && dash < 0.4) || std::abs(place.road - (half - 0.3)) < 0.06))
      return Blend(base, paint, flaked);
    return base;
  }

 private:
  const AerialLayout& layout_;
  const MaterialLibrary& materials_;
  double x_, y_;
  uint64_t seed_;
};

// Calls paint(x, y, u, v, texel) for the texels of a turned rectangle that lie in rows [begin, end).
template <typename Paint>
void ForEachTexel(const AerialOptions& options, double cx, double cy, double half_x, double half_y, double yaw,
                  int begin, int end, Image* image, Paint paint) {
  const double scale = 1 / options.texel, reach = std::hypot(half_x, half_y);
  const double c = std::cos(yaw), s = std::sin(yaw);
  const int low_y = std::max(begin, static_cast<int>((cy - reach - options.y0) * scale));
  const int high_y = std::min(end - 1, static_cast<int>((cy + reach - options.y0) * scale));
  const int low_x = std::max(0, static_cast<int>((cx - reach - options.x0) * scale));
  const int high_x = std::min(image->width - 1, static_cast<int>((cx + reach - options.x0) * scale));
  for (int j = low_y; j <= high_y; ++j) {
    for (int i = low_x; i <= high_x; ++i) {
      const double x = options.x0 + (i + 0.5) * options.texel, y = options.y0 + (j + 0.5) * options.texel;
      const double u = c * (x - cx) + s * (y - cy), v = -s * (x - cx) + c * (y - cy);
      if (std::abs(u) > half_x || std::abs(v) > half_y) continue;
      paint(x, y, u, v, &image->At(i, j));
    }
  }
}

Color Court(const Pad& pad, double u, double v) {
  const bool blue = pad.seed & 1;
  const Color border = blue ? Rgb(92, 140, 96) : Rgb(120, 140, 118), inner = blue ? Rgb(60, 110, 170) : border;
  if (pad.half_x - std::abs(u) < 0.25 || pad.half_y - std::abs(v) < 0.25) return Rgb(50, 70, 55);
  const double a = std::abs(u) - (pad.half_x - 3), b = std::abs(v) - (pad.half_y - 3);
  if (a > 0.1 || b > 0.1) return border;
  const bool line = a > -0.1 || b > -0.1 || std::abs(u) < 0.06 ||
                    (std::abs(v) < 0.06 && std::abs(u) < pad.half_x * 0.5) ||
                    std::abs(std::abs(u) - pad.half_x * 0.5) < 0.06 || std::abs(std::hypot(u, v) - 2) < 0.06;
  return line ? Rgb(225, 228, 225) : inner;
}

}  // namespace

Color GroundCover(const AerialLayout& layout, const MaterialLibrary& materials, double x, double y) {
  const AerialOptions& options = layout.Options();
  for (const Lake& lake : options.lakes) {
    const double shore = layout.LakeDistance(lake, x, y);
    if (shore > 1.06) continue;
    const Color water = Rgb(104, 132, 118);
    if (shore < 1) return Leafy(water, 0);
    return Blend(water, Ground(layout, materials, x, y).Marsh() * 0.8f, (shore - 1) / 0.06 + 0.3);
  }
  if (options.repeat_x > 0) x -= options.repeat_x * std::floor((x - options.x0) / options.repeat_x);
  const AerialLayout::Place place = layout.At(x, y);
  const Ground ground(layout, materials, x, y);
  if (place.road < 4.6) return ground.Road(place);
  Color color = {};
  switch (place.land) {
    case Land::kHouses:
      color = ground.Park();
      break;
    case Land::kPark:
      color = ground.Park();
      break;
    case Land::kFields:
      color = ground.Fields(place);
      break;
    case Land::kMarsh:
      color = ground.Marsh();
      break;
    case Land::kForest:
      color = ground.Forest();
      break;
  }
  const double verge = Smooth(7.0, 5.0, place.road + 1.5 * Fbm(x / 4, y / 4, 3, 0.6, place.seed));
  // The photographs' own tufts come again and again; these never do. Without them all places share too many visual
  // words.
  const double grain = Fbm(x / 0.75, y / 0.75, 3, 0.75, Hash(options.seed, 23));
  const double patchy = 0.6 + 0.8 * Fbm(x / 13, y / 13, 2, 0.5, Hash(options.seed, 24));
  color = Blend(color, ground.Park(), verge);
  return Leafy(color * static_cast<float>(1 + options.grain * patchy * grain), color[3] / 255);
}

void PaintPads(const AerialLayout& layout, const MaterialLibrary& materials, int begin, int end, Image* image) {
  for (const Pad& pad : layout.pads) {
    const uint64_t seed = pad.seed;
    ForEachTexel(layout.Options(), pad.x, pad.y, pad.half_x, pad.half_y, pad.yaw, begin, end, image,
                 [&](double x, double y, double u, double v, uint32_t* texel) {
                   if (layout.At(x, y).road < 4.6) return;
                   for (const Lake& lake : layout.Options().lakes) {
                     if (layout.LakeDistance(lake, x, y) < 1.06) return;
                   }
                   const Color old = Unpack(*texel);
                   Color color = old;
                   switch (pad.kind) {
                     case Pad::Kind::kYard: {
                       const Material& grass = seed % 3 == 0   ? materials.dry_lawn
                                               : seed % 3 == 1 ? materials.lawn
                                                               : materials.meadow;
                       color = grass.At(x / kPhotoTexel, y / kPhotoTexel, seed) * Tint(x, y, 0.2, seed) *
                               static_cast<float>(0.85 + 0.25 * Unit(Hash(seed)));
                       color = Blend(color, materials.bush.At(x / kPhotoTexel, y / kPhotoTexel, seed + 1) * 0.75f,
                                     Smooth(0.34, 0.42, Fbm(x / 5, y / 5, 4, 0.6, seed + 2)));
                       color = Leafy(color, 1.1 * kLawnLeaves);
                       if (pad.half_x - std::abs(u) < 0.15) color = Rgb(96, 84, 70);
                       break;
                     }
                     case Pad::Kind::kDriveway:
                       color = Concrete(u, v, seed);
                       break;
                     case Pad::Kind::kPool:
                       color = std::hypot(u / 2.7, v / 1.6) < 1
                                   ? Rgb(130, 205, 205) * static_cast<float>(1 + 0.1 * Fbm(x, y, 3, 0.6, seed))
                                   : Concrete(u, v, seed) * 1.1f;
                       break;
                     case Pad::Kind::kCourt:
                       color = Court(pad, u, v) * static_cast<float>(1 + 0.07 * Fbm(x / 3, y / 3, 4, 0.6, seed));
                       break;
                     case Pad::Kind::kFence:
                       color = Rgb(120, 100, 80);
                       break;
                     case Pad::Kind::kPath:
                       color = std::abs(u + Fbm(v / 25, 0.5, 2, 0.5, seed)) < 0.7 ? Concrete(u, v, seed) : old;
                       break;
                   }
                   if (pad.kind != Pad::Kind::kYard && pad.kind != Pad::Kind::kPath) color[3] = 0;
                   *texel = Pack(color);
                 });
  }
}

void PaintTrees(const AerialLayout& layout, const MaterialLibrary& materials, int begin, int end, Image* image) {
  for (const Tree& tree : layout.trees) {
    const double reach = tree.radius * 1.1 + 0.2, scale = 1 / layout.Options().texel;
    if ((tree.y + reach - layout.Options().y0) * scale < begin || (tree.y - reach - layout.Options().y0) * scale > end)
      continue;
    const Crown shape(tree);
    Random random(tree.seed + 1);
    const Color tint = Rgb(random.Uniform(0.95, 1.5), random.Uniform(1.0, 1.3), random.Uniform(0.8, 1.2)) *
                       static_cast<float>(random.Uniform(0.85, 1.2));
    ForEachTexel(layout.Options(), tree.x, tree.y, reach, reach, 0, begin, end, image,
                 [&](double x, double y, double, double, uint32_t* texel) {
                   const double ragged = 0.35 * Fbm(x / 0.9, y / 0.9, 3, 0.6, tree.seed);
                   const double crown = shape.Height(x + ragged, y + ragged);
                   const double edge = std::hypot(x - tree.x, y - tree.y) + 2 * ragged;
                   if (crown <= 0 && edge > tree.radius) return;
                   const Color leaves =
                       Faded(materials.crown.At(x / kPhotoTexel, y / kPhotoTexel, tree.seed) * tint, 0.6f);
                   const double bright = crown <= 0 ? 0.7 : 0.85 + 0.55 * crown / tree.height;
                   *texel = Pack(Leafy(leaves * static_cast<float>(bright), kTreeLeaves));
                 });
  }
}

Crown::Crown(const Tree& tree) : tree_(tree) {
  Random random(tree.seed);
  for (int k = 0; k < 14; ++k) {
    const double x = random.Uniform(-1, 1), y = random.Uniform(-1, 1), size = random.Uniform(0.22, 0.42);
    if (x * x + y * y < 0.7) domes_.push_back({x, y, size, 0.45 + 0.35 * std::sqrt(1 - 0.7 * (x * x + y * y))});
  }
}

double Crown::Height(double x, double y) const {
  const double dx = (x - tree_.x) / tree_.radius, dy = (y - tree_.y) / tree_.radius;
  const double r2 = dx * dx + dy * dy;
  if (r2 > 1.2) return 0;
  double height = r2 < 0.8 ? 0.5 + 0.35 * std::sqrt(1 - r2 / 0.8) : 0;
  for (const Dome& dome : domes_) {
    const double d2 = ((dx - dome.x) * (dx - dome.x) + (dy - dome.y) * (dy - dome.y)) / (dome.size * dome.size);
    if (d2 < 1) height = std::max(height, dome.base + 0.9 * dome.size * std::sqrt(1 - d2));
  }
  return tree_.height * height;
}

}  // namespace mapmend::simulate

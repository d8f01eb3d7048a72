#include "tools/simulate/material.h"

namespace mapmend::simulate {
namespace {

// Mean over a square of half-width radius, by a summed-area table; the square is cut at the border.
std::vector<Color> BoxBlur(const std::vector<Color>& in, int width, int height, int radius) {
  std::vector<Color> out(in.size()), rows(in.size());
  const auto pass = [&](const std::vector<Color>& from, std::vector<Color>* to, int count, int lines, int step,
                        int line_step) {
    for (int l = 0; l < lines; ++l) {
      for (int i = 0; i < count; ++i) {
        Color sum = {};
        const int begin = std::max(0, i - radius), end = std::min(count - 1, i + radius);
        for (int k = begin; k <= end; ++k)
          sum += from[static_cast<size_t>(l) * line_step + static_cast<size_t>(k) * step];
        (*to)[static_cast<size_t>(l) * line_step + static_cast<size_t>(i) * step] =
            sum * (1.f / static_cast<float>(end - begin + 1));
      }
    }
  };
  pass(in, &rows, width, height, 1, width);
  pass(rows, &out, height, width, width, 1);
  return out;
}

// A random number in [-1, 1] per square of the given size, constant in it.
double Grain(double x, double y, double size, uint64_t seed) {
  const auto i = static_cast<int64_t>(std::floor(x / size)), j = static_cast<int64_t>(std::floor(y / size));
  return 2 * Unit(Hash(seed, static_cast<uint64_t>(i) * 0x9e3779b1ULL ^ static_cast<uint64_t>(j) << 32)) - 1;
}

Color Grey(const Color& base, double amount) { return base * static_cast<float>(1 + amount); }

}  // namespace

Material::Material(const Image& photograph)
    : width_(photograph.width), height_(photograph.height), edge_(0.42 * std::min(width_, height_)), mean_{} {
  std::vector<Color> pixels(photograph.texels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = Unpack(photograph.texels[i]);
    mean_ += pixels[i];
  }
  mean_ *= 1.f / static_cast<float>(pixels.size());
  const auto wide = BoxBlur(pixels, width_, height_, std::min(width_, height_) / 6);
  difference_.resize(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) difference_[i] = pixels[i] - wide[i];
}

Color Material::At(double x, double y, uint64_t seed) const {
  // Lattice coordinates: corners at integers (a, b) lie at edge * (a + b / 2, b * sqrt(3) / 2).
  const double b = y / (edge_ * 0.8660254037844386), a = x / edge_ - 0.5 * b;
  const double fa = std::floor(a), fb = std::floor(b);
  const double u = a - fa, v = b - fb;
  const auto ia = static_cast<int64_t>(fa), ib = static_cast<int64_t>(fb);
  const bool upper = u + v > 1;
  const std::array<double, 3> weight = upper ? std::array{u + v - 1, 1 - v, 1 - u} : std::array{1 - u - v, u, v};
  const int64_t ca[3] = {upper ? ia + 1 : ia, ia + 1, ia};
  const int64_t cb[3] = {upper ? ib + 1 : ib, ib, ib + 1};
  Color sum = {};
  float squares = 0;
  for (int k = 0; k < 3; ++k) {
    if (weight[k] < 1e-3) continue;
    const uint64_t hash = Hash(seed, static_cast<uint64_t>(ca[k]) * 0x8da6b343ULL ^ static_cast<uint64_t>(cb[k]) << 32);
    const double x0 = edge_ * (static_cast<double>(ca[k]) + 0.5 * static_cast<double>(cb[k]));
    const double y0 = edge_ * 0.8660254037844386 * static_cast<double>(cb[k]);
    double dx = x - x0, dy = y - y0;
    if (hash & 1) dx = -dx, dy = -dy;
    if (hash & 2) dx = -dx;
    // The window may lie anywhere as long as it does not leave the photograph.
    const double reach = edge_ + 1;
    const double px = reach + Unit(hash) * (width_ - 1 - 2 * reach) + dx;
    const double py = reach + Unit(Hash(hash)) * (height_ - 1 - 2 * reach) + dy;
    const int ix = std::clamp(static_cast<int>(px + 0.5), 0, width_ - 1),
              iy = std::clamp(static_cast<int>(py + 0.5), 0, height_ - 1);
    const auto w = static_cast<float>(weight[k] * weight[k] * weight[k]);  // sharp seams: keeps structures whole
    sum += difference_[static_cast<size_t>(iy) * width_ + ix] * w;
    squares += w * w;
  }
  return mean_ + sum * (1.f / std::sqrt(squares));
}

MaterialLibrary::MaterialLibrary(const std::string& folder)
    : lawn(ReadImage(folder + "/lawn.png")),
      dry_lawn(ReadImage(folder + "/dry_lawn.png")),
      meadow(ReadImage(folder + "/meadow.png")),
      marsh(ReadImage(folder + "/marsh.png")),
      bush(ReadImage(folder + "/bush.png")),
      crown(ReadImage(folder + "/crown.png")),
      photos(ReadImage(folder + "/photos.jpg")) {}

Color Asphalt(double x, double y, uint64_t seed) {
  const double patch = Fbm(x / 6, y / 6, 3, 0.6, seed), grain = Grain(x, y, 0.06, seed + 1);
  const double crack = std::abs(Fbm(x / 3.1, y / 3.1, 4, 0.55, seed + 2)) < 0.012 ? -0.05 : 0;
  return Grey(Rgb(134, 134, 138), 0.10 * patch + 0.05 * grain + crack);
}

Color Concrete(double x, double y, uint64_t seed) {
  const double stain = Fbm(x / 2.3, y / 2.3, 4, 0.6, seed);
  const auto joint = [](double v) { return v - std::floor(v) < 0.04; };
  const double line = joint(x / 1.5) || joint(y / 1.5) ? -0.05 : 0;
  return Grey(Rgb(196, 192, 182), 0.09 * stain + 0.03 * Grain(x, y, 0.05, seed) + line);
}

Color Shingles(double x, double y, const Color& base, uint64_t seed) {
  const double row = std::floor(y / 0.3), stain = Fbm(x / 2.5, y / 1.3, 4, 0.6, seed);
  const double tile = Grain(x + 0.4 * Unit(Hash(seed, static_cast<uint64_t>(row + 4096))), y, 0.3, seed);
  const double edge = y / 0.3 - row < 0.2 ? -0.07 : 0;
  return Grey(base, 0.12 * stain + 0.05 * tile + edge);
}

Color Bricks(double x, double y, const Color& base, uint64_t seed) {
  const double row = std::floor(y / 0.08);
  const double shifted = x + (static_cast<int64_t>(row) & 1 ? 0.12 : 0);
  const double column = std::floor(shifted / 0.24);
  const bool mortar = y / 0.08 - row < 0.14 || shifted / 0.24 - column < 0.05;
  if (mortar) return Grey(Rgb(170, 165, 155), 0.1 * Fbm(x, y, 3, 0.5, seed));
  return Grey(base, 0.16 * Grain(column + 0.5, row + 0.5, 1, seed) + 0.15 * Fbm(x / 2, y / 2, 4, 0.6, seed + 1));
}

Color Wood(double x, double y, const Color& base, uint64_t seed) {
  const double grain = Fbm(x / 0.35, y / 0.02, 4, 0.6, seed), knot = Fbm(x / 0.5, y / 0.12, 3, 0.6, seed + 1);
  return Grey(base, 0.14 * grain + 0.12 * knot);
}

Color Carpet(double x, double y, const Color& base, uint64_t seed) {
  const double stripe = Grain(x, y / 12, 0.05, seed), tuft = Grain(x, y, 0.012, seed + 1),
               wear = Fbm(x / 1.2, y / 1.2, 4, 0.6, seed + 2);
  return Grey(base, 0.14 * stripe + 0.16 * tuft + 0.14 * wear);
}

}  // namespace mapmend::simulate

#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "tools/simulate/texture.h"

namespace mapmend::simulate {

// Leaves and blades too small for the height field. Which of them a pixel sees depends on where it looks from and on
// the wind, so vegetation does not look the same from two places: a random brightness per cell of a grid of about the
// pixel's size on the ground, which lasts over a certain range of viewing directions and for a certain time, both
// different from cell to cell. A function of place, direction and time alone.
struct CanopyView {
  int32_t x = 0, y = 0, time = 0;  // in units of 1/1024 of what a cell lasts

  static constexpr float kLevelWeight[3] = {1.f, 0.9f, 0.8f};  // of the size of a pixel, twice and four times that

  // slope_x, slope_y: how far a ray goes sideways per metre down. `angle`: how much of that a cell lasts.
  static CanopyView From(double slope_x, double slope_y, double angle, int32_t time) {
    return {static_cast<int32_t>(std::floor(slope_x * (1024 / angle))),
            static_cast<int32_t>(std::floor(slope_y * (1024 / angle))), time};
  }
};

using UInt4 = uint32_t __attribute__((vector_size(16)));

// Random brightness in [-1, 1] of as many cells (i, j) as the vectors have.
template <typename Int, typename UInt, typename Float>
[[gnu::always_inline]] inline void CanopyCells(const Int& i, const Int& j, const Int& layer, int level,
                                               const CanopyView& view, Float* cells) {
  UInt h = (UInt)i * 0x8da6b343u + (UInt)j * 0xd8163841u + static_cast<uint32_t>(level) * 0x9e3779b1u +
           (UInt)layer * 0xb55a4f09u;
  h = (h ^ h >> 16) * 0x7feb352du;
  h = (h ^ h >> 15) * 0x846ca68bu;
  h ^= h >> 16;
  // When a cell changes is random too.
  const Int from_x = (Int)(h & 1023u) + view.x, from_y = (Int)(h >> 10 & 1023u) + view.y,
            from_time = (Int)(h >> 20 & 1023u) + view.time;
  UInt g = h + (UInt)(from_x >> 10) * 0x9e3779b1u + (UInt)(from_y >> 10) * 0x85ebca6bu +
           (UInt)(from_time >> 10) * 0xc2b2ae35u;
  g = (g ^ g >> 15) * 0x2c1b3c6du;
  g = (g ^ g >> 12) * 0x297a2d39u;
  g ^= g >> 15;
  *cells = __builtin_convertvector((Int)g, Float) * 0x1.0p-31f;
}

// rows x stride cells, stride a multiple of 8, times weight; cells[0] is (i, j). Uses what the processor has, with the
// same bits.
void FillCanopy(int i, int j, int rows, int stride, int level, float weight, const CanopyView& view, float* cells);

// The brightness at a point, x and y in texels of level 0, bilinear within a level.
inline float CanopyLevel(double x, double y, double z, int level, const CanopyView& view) {
  const double scale = std::ldexp(1.0, -level);
  const double u = (x + 0.5) * scale - 0.5, v = (y + 0.5) * scale - 0.5;
  const double fu = std::floor(u), fv = std::floor(v);
  const auto i = static_cast<int32_t>(fu), j = static_cast<int32_t>(fv);
  Color c;
  CanopyCells<Int4, UInt4>(Int4{i, i + 1, i, i + 1}, Int4{j, j, j + 1, j + 1},
                           Int4{} + static_cast<int>(std::floor(z * scale)), level, view, &c);
  const auto a = static_cast<float>(u - fu), b = static_cast<float>(v - fv);
  const float top = c[0] + (c[1] - c[0]) * a, bottom = c[2] + (c[3] - c[2]) * a;
  return top + (bottom - top) * b;
}

// Levels of the grid and their weights for a pixel whose footprint has this log2 in texels.
struct CanopyLevels {
  int first = 0;
  float weight[4] = {};

  explicit CanopyLevels(float lod) {
    lod = std::clamp(lod, -5.f, 8.f);
    first = static_cast<int>(std::floor(lod));
    const float f = lod - static_cast<float>(first);
    weight[0] = CanopyView::kLevelWeight[0] * (1 - f);
    weight[1] = CanopyView::kLevelWeight[0] * f + CanopyView::kLevelWeight[1] * (1 - f);
    weight[2] = CanopyView::kLevelWeight[1] * f + CanopyView::kLevelWeight[2] * (1 - f);
    weight[3] = CanopyView::kLevelWeight[2] * f;
  }
};

// Points of a piece of the image. x, y: texels of level 0 relative to the origin, not below 0; z: texels, not relative.
struct CanopyPoints {
  static constexpr int kCount = 8;
  float x[kCount], y[kCount], z[kCount];
};

// As Canopy, at all the points at once. Uses what the processor has, with the same bits.
void CanopyAt(const CanopyPoints& points, double origin_x, double origin_y, const CanopyLevels& levels,
              const CanopyView& view, float* brightness);

inline float Canopy(double x, double y, double z, float lod, const CanopyView& view) {
  const CanopyLevels levels(lod);
  float sum = 0;
  for (int l = 0; l < 4; ++l) {
    if (levels.weight[l] > 0.02f) sum += levels.weight[l] * CanopyLevel(x, y, z, levels.first + l, view);
  }
  return sum;
}

}  // namespace mapmend::simulate

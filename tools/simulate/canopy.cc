#include "tools/simulate/canopy.h"

#include <cstring>

namespace mapmend::simulate {
namespace {

using UInt8 = uint32_t __attribute__((vector_size(32)));

[[gnu::always_inline]] inline void Fill(int i, int j, int rows, int stride, int level, float weight,
                                        const CanopyView& view, float* cells) {
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < stride; column += 8) {
      const Int8 is = Int8{0, 1, 2, 3, 4, 5, 6, 7} + (i + column), js = Int8{} + (j + row);
      Float8 values;
      CanopyCells<Int8, UInt8>(is, js, Int8{}, level, view, &values);
      values *= weight;
      std::memcpy(cells + row * stride + column, &values, sizeof values);
    }
  }
}

[[gnu::always_inline]] inline void At(const CanopyPoints& points, double origin_x, double origin_y,
                                      const CanopyLevels& levels, const CanopyView& view, float* brightness) {
  Float8 x, y, z, sum = {};
  std::memcpy(&x, points.x, sizeof x);
  std::memcpy(&y, points.y, sizeof y);
  std::memcpy(&z, points.z, sizeof z);
  for (int l = 0; l < 4; ++l) {
    if (levels.weight[l] <= 0.02f) continue;
    const int level = levels.first + l;
    const double scale = std::ldexp(1.0, -level);
    const double u0 = (origin_x + 0.5) * scale - 0.5, v0 = (origin_y + 0.5) * scale - 0.5;
    const double fu = std::floor(u0), fv = std::floor(v0);
    const auto factor = static_cast<float>(scale);
    const Float8 u = x * factor + static_cast<float>(u0 - fu), v = y * factor + static_cast<float>(v0 - fv);
    const Int8 i = __builtin_convertvector(u, Int8), j = __builtin_convertvector(v, Int8);
    const Float8 a = u - __builtin_convertvector(i, Float8), b = v - __builtin_convertvector(j, Float8);
    // Towards zero where the others are cut off downwards: heights are rarely below zero.
    const Int8 layer = __builtin_convertvector(z * factor, Int8);
    const Int8 left = i + static_cast<int>(fu), low = j + static_cast<int>(fv);
    Float8 c00, c10, c01, c11;
    CanopyCells<Int8, UInt8>(left, low, layer, level, view, &c00);
    CanopyCells<Int8, UInt8>(left + 1, low, layer, level, view, &c10);
    CanopyCells<Int8, UInt8>(left, low + 1, layer, level, view, &c01);
    CanopyCells<Int8, UInt8>(left + 1, low + 1, layer, level, view, &c11);
    const Float8 top = c00 + (c10 - c00) * a, bottom = c01 + (c11 - c01) * a;
    sum += (top + (bottom - top) * b) * levels.weight[l];
  }
  std::memcpy(brightness, &sum, sizeof sum);
}

#if defined(__x86_64__)
[[gnu::target("avx2")]] void AtWide(const CanopyPoints& points, double origin_x, double origin_y,
                                    const CanopyLevels& levels, const CanopyView& view, float* brightness) {
  At(points, origin_x, origin_y, levels, view, brightness);
}
[[gnu::target("avx2")]] void FillWide(int i, int j, int rows, int stride, int level, float weight,
                                      const CanopyView& view, float* cells) {
  Fill(i, j, rows, stride, level, weight, view, cells);
}
#endif

}  // namespace

void FillCanopy(int i, int j, int rows, int stride, int level, float weight, const CanopyView& view, float* cells) {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2");
  if (wide) return FillWide(i, j, rows, stride, level, weight, view, cells);
#endif
  Fill(i, j, rows, stride, level, weight, view, cells);
}

void CanopyAt(const CanopyPoints& points, double origin_x, double origin_y, const CanopyLevels& levels,
              const CanopyView& view, float* brightness) {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2");
  if (wide) return AtWide(points, origin_x, origin_y, levels, view, brightness);
#endif
  At(points, origin_x, origin_y, levels, view, brightness);
}

}  // namespace mapmend::simulate

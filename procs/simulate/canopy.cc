#include "procs/simulate/canopy.h"

#include <cstring>

namespace mapmend::simulate {
namespace {

using Int8 = int32_t __attribute__((vector_size(32)));
using UInt8 = uint32_t __attribute__((vector_size(32)));
using Float8 = float __attribute__((vector_size(32)));

[[gnu::always_inline]] inline void Fill(int i, int j, int rows, int stride, int level, float weight,
                                        const CanopyView& view, float* cells) {
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < stride; column += 8) {
      const Int8 is = Int8{0, 1, 2, 3, 4, 5, 6, 7} + (i + column), js = Int8{} + (j + row);
      Float8 values;
      CanopyCells<Int8, UInt8>(is, js, 0, level, view, &values);
      values *= weight;
      std::memcpy(cells + row * stride + column, &values, sizeof values);
    }
  }
}

#if defined(__x86_64__)
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

}  // namespace mapmend::simulate

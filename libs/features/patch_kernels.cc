#include "libs/features/patch_kernels.h"

#include <bit>
#include <cstring>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace mapmend {
namespace {

// Disc of radius 15: mask[y][x] is 255 where (x - 15)^2 + y^2 <= 15^2; column 31 is outside.
struct Disc {
  uint8_t mask[16][32] = {};
  constexpr Disc() {
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 31; ++x) mask[y][x] = (x - 15) * (x - 15) + y * y <= 15 * 15 ? 255 : 0;
    }
  }
};
constexpr Disc kDisc;

namespace portable {
#define LANES 16
#include "libs/features/patch_kernels_body.inc"
#undef LANES
}  // namespace portable

#if defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
#define LANES 32
#include "libs/features/patch_kernels_body.inc"
#undef LANES
}  // namespace avx2
#pragma GCC pop_options
#endif

}  // namespace

const PatchKernels& PatchKernels::Portable() { return portable::kKernels; }

const PatchKernels& PatchKernels::Get() {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return avx2::kKernels;
#endif
  return portable::kKernels;
}

}  // namespace mapmend

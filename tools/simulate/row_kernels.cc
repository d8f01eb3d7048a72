#include "tools/simulate/row_kernels.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "tools/simulate/random.h"

// Vectors of eight are passed between functions of this file only.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace mapmend::simulate {
namespace {

namespace portable {
#include "tools/simulate/row_kernels_body.inc"
}  // namespace portable

#if defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx2")
#define MAPMEND_AVX2
namespace avx2 {
#include "tools/simulate/row_kernels_body.inc"
}  // namespace avx2
#undef MAPMEND_AVX2
#pragma GCC pop_options
#endif

}  // namespace

const RowKernels& RowKernels::Portable() { return portable::kKernels; }

const RowKernels& RowKernels::Get() {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2");
  if (wide) return avx2::kKernels;
#endif
  return portable::kKernels;
}

}  // namespace mapmend::simulate

#pragma once

#include <cstddef>
#include <cstdint>

namespace mapmend {

// The inner loops of ORB extraction, once for plain SSE (or any machine) and once for AVX2, chosen at run time. All are
// integer arithmetic: both give the same bits. Images are rows of stride bytes; each row must be readable for
// kReadAhead bytes beyond what the function's result needs.
struct PatchKernels {
  static constexpr int kReadAhead = 64;
  static constexpr int kBlurStride = 48;  // of a blurred patch
  static constexpr int kBlurRadius = 19;  // a blurred patch covers x and y from -19 to 19
  static constexpr int kMomentRadius = 15;

  // FAST-9 scores of pixels [begin, end) of a row: the largest t for which nine contiguous pixels of the circle of
  // radius 3 are all brighter, or all darker, than the centre by t or more; 0 if not above threshold. Writes up to
  // kReadAhead bytes of zeros or scores beyond end. Returns whether there is any.
  bool (*fast_row)(const uint8_t* row, ptrdiff_t stride, int begin, int end, uint8_t threshold, uint8_t* scores);

  // Finds the pixels of [begin, end) whose score is above 0 and a maximum of its 3x3 neighbourhood (of equal neighbours
  // the first in reading order). Writes their x to found, ascending, and returns how many they are.
  int (*maxima_row)(const uint8_t* above, const uint8_t* row, const uint8_t* below, int begin, int end, int16_t* found);

  // 7x7 Gaussian, sigma 2, of the patch around center; reads 22 pixels around it. Pixel (x, y) of the result is
  // out[(y + 19) * 48 + x + 19].
  void (*blur_patch)(const uint8_t* center, ptrdiff_t stride, uint8_t* out);

  // First moments of the disc of radius 15 around center: m10 = sum x I, m01 = sum y I.
  void (*moments)(const uint8_t* center, ptrdiff_t stride, int* m10, int* m01);

  // Sums over the 7x7 window around center of products of Sobel gradients; weighted by window coordinates in the last
  // two.
  struct Tensor {
    int32_t xx, xy, yy;  // gx gx, gx gy, gy gy
  };
  Tensor (*tensor)(const uint8_t* center, ptrdiff_t stride);

  // The kernels for this processor.
  static const PatchKernels& Get();
  // Those that every machine has, for tests.
  static const PatchKernels& Portable();
};

}  // namespace mapmend

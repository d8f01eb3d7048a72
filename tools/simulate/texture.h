#pragma once

#if defined(__SSE4_1__)
#include <smmintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "tools/simulate/big_vector.h"

namespace mapmend::simulate {

// Four floats added and multiplied at once; GCC's and Clang's vector extension. Red, green, blue, unused; [0, 255].
// What compilers do not turn into single instructions is written with intrinsics as well; both give the same bits.
using Color = float __attribute__((vector_size(16)));

using Int4 = int32_t __attribute__((vector_size(16)));
using Float8 = float __attribute__((vector_size(32)));
using Int8 = int32_t __attribute__((vector_size(32)));

inline Color Rgb(double r, double g, double b) {
  return Color{static_cast<float>(r), static_cast<float>(g), static_cast<float>(b), 0.f};
}
inline float Luminance(const Color& c) { return 0.299f * c[0] + 0.587f * c[1] + 0.114f * c[2]; }

// Four bytes, cut off below the point and clamped to [0, 255].
inline uint32_t PackTruncated(const Color& c) {
#if defined(__SSE4_1__)
  const __m128i whole = _mm_cvttps_epi32(c), half = _mm_packs_epi32(whole, whole);
  return static_cast<uint32_t>(_mm_cvtsi128_si32(_mm_packus_epi16(half, half)));
#else
  const auto byte = [](float v) { return static_cast<uint32_t>(std::clamp(v, 0.f, 255.f)); };
  return byte(c[0]) | byte(c[1]) << 8 | byte(c[2]) << 16 | byte(c[3]) << 24;
#endif
}
inline uint32_t Pack(const Color& c) { return PackTruncated(c + 0.5f); }
inline Color Unpack(uint32_t texel) {
#if defined(__SSE4_1__)
  return _mm_cvtepi32_ps(_mm_cvtepu8_epi32(_mm_cvtsi32_si128(static_cast<int>(texel))));
#else
  return {static_cast<float>(texel & 255), static_cast<float>(texel >> 8 & 255), static_cast<float>(texel >> 16 & 255),
          static_cast<float>(texel >> 24)};
#endif
}

// Bilinear lookups in whole numbers, in units of 1/128: texels t[0], t[1] and those of the row below. fx in [0, 32767],
// fy in [0, 128]; only the lower half of the result counts.
using Short8 = int16_t __attribute__((vector_size(16)));
inline Short8 MultiplyRounded(const Short8& a, const Short8& b) {
#if defined(__SSE4_1__)
  return (Short8)_mm_mulhrs_epi16((__m128i)a, (__m128i)b);
#else
  Short8 result;
  for (int k = 0; k < 8; ++k) result[k] = static_cast<int16_t>((a[k] * b[k] + 0x4000) >> 15);
  return result;
#endif
}
inline Short8 TwoTexels(const uint32_t* t) {
  uint8_t bytes __attribute__((vector_size(8)));
  std::memcpy(&bytes, t, 8);
  return __builtin_convertvector(bytes, Short8);
}
inline Short8 BilinearWhole(const uint32_t* t, int width, const Short8& fx, const Short8& fy) {
  const Short8 above = TwoTexels(t), below = TwoTexels(t + width);
  const Short8 both = above * 128 + (below - above) * fy;
  const Short8 right = __builtin_shuffle(both, Short8{4, 5, 6, 7, 4, 5, 6, 7});
  return both + MultiplyRounded(right - both, fx);
}
inline Color FromWhole(const Short8& v) {
#if defined(__SSE4_1__)
  return _mm_cvtepi32_ps(_mm_cvtepi16_epi32((__m128i)v)) * (1.f / 128);
#else
  return Color{static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), static_cast<float>(v[3])} *
         (1.f / 128);
#endif
}

// Squares of stored values, proportional to light; rounded to integers.
using Light = uint16_t __attribute__((vector_size(8)));
inline Light PackLight(const Color& stored) {
  const Color light = stored * stored + 0.5f;
#if defined(__SSE4_1__)
  const __m128i whole = _mm_cvttps_epi32(light);
  Light result;
  _mm_storel_epi64(reinterpret_cast<__m128i*>(&result), _mm_packus_epi32(whole, whole));
  return result;
#else
  const auto pack = [](float v) { return static_cast<uint16_t>(std::min(v, 65535.f)); };
  return Light{pack(light[0]), pack(light[1]), pack(light[2]), pack(light[3])};
#endif
}
inline Color UnpackLight(const Light& light) {
#if defined(__SSE4_1__)
  return _mm_cvtepi32_ps(_mm_cvtepu16_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&light))));
#else
  return {static_cast<float>(light[0]), static_cast<float>(light[1]), static_cast<float>(light[2]),
          static_cast<float>(light[3])};
#endif
}

inline Color SquareRoot(const Color& v) {
#if defined(__SSE4_1__)
  return _mm_sqrt_ps(v);
#else
  return Color{std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])};
#endif
}

// Bit k: lane k, of zeros or ones, is of ones.
inline unsigned Lanes(const Int4& v) {
#if defined(__SSE4_1__)
  return static_cast<unsigned>(_mm_movemask_ps((__m128)v));
#else
  unsigned bits = 0;
  for (int k = 0; k < 4; ++k) bits |= v[k] != 0 ? 1u << k : 0;
  return bits;
#endif
}

// log2 to 1e-2, from the bits of the float: enough to choose a mipmap, fast, and the same on every machine.
inline float Log2(float x) {
  const auto bits = std::bit_cast<uint32_t>(x);
  const float exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  const float mantissa = std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000);
  return exponent + (-1.0f / 3 * mantissa + 2) * mantissa - 5.0f / 3;
}

// A picture, row by row, 8 bits a channel; texel centres at integers.
struct Image {
  int width = 0, height = 0;
  BigVector<uint32_t> texels;

  Image() = default;
  Image(int w, int h, Color fill = Color{}) : width(w), height(h), texels(static_cast<size_t>(w) * h, Pack(fill)) {}
  uint32_t& At(int x, int y) { return texels[static_cast<size_t>(y) * width + x]; }
  uint32_t At(int x, int y) const { return texels[static_cast<size_t>(y) * width + x]; }
  // Bilinear, clamped to the border.
  Color Bilinear(float x, float y) const {
    x = std::clamp(x, 0.f, static_cast<float>(width - 1));
    y = std::clamp(y, 0.f, static_cast<float>(height - 1));
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float fx = x - static_cast<float>(ix), fy = y - static_cast<float>(iy);
    const uint32_t* row = texels.data() + static_cast<size_t>(iy) * width + ix;
    const int right = ix + 1 < width ? 1 : 0, down = iy + 1 < height ? width : 0;
    const Color a = Unpack(row[0]), b = Unpack(row[right]), c = Unpack(row[down]), d = Unpack(row[down + right]);
    const Color top = a + (b - a) * fx, bottom = c + (d - c) * fx;
    return top + (bottom - top) * fy;
  }
};

// Reads a PNG or JPEG. Throws std::runtime_error naming the file.
Image ReadImage(const std::string& path);

// An image with its mipmaps: level i is smaller by 2^i, each texel the mean of four below.
class Texture {
 public:
  explicit Texture(Image image, int num_threads = 1);

  int Width() const { return levels_[0].width; }
  int Height() const { return levels_[0].height; }
  int NumLevels() const { return static_cast<int>(levels_.size()); }
  const Image& Level(int level) const { return levels_[level]; }
  // The coarsest level of at least 2 x 2 texels.
  int LastWhole() const {
    const Image& last = levels_.back();
    return NumLevels() - (NumLevels() > 1 && std::min(last.width, last.height) < 2 ? 2 : 1);
  }
  // Trilinear. x, y: texels of level 0; lod: log2 of the footprint in texels, below 0 means magnified.
  Color Sample(float x, float y, float lod) const {
    lod = std::clamp(lod, 0.f, static_cast<float>(levels_.size() - 1));
    const int level = static_cast<int>(lod);
    const float fraction = lod - static_cast<float>(level);
    const Color fine = SampleLevel(level, x, y);
    if (fraction < 0.02f || level + 1 >= static_cast<int>(levels_.size())) return fine;
    return fine + (SampleLevel(level + 1, x, y) - fine) * fraction;
  }

 private:
  Color SampleLevel(int level, float x, float y) const {
    const float scale = kScale[level];
    return levels_[level].Bilinear((x + 0.5f) * scale - 0.5f, (y + 0.5f) * scale - 0.5f);
  }

  static constexpr float kScale[16] = {1.f,        1.f / 2,    1.f / 4,     1.f / 8,    1.f / 16,   1.f / 32,
                                       1.f / 64,   1.f / 128,  1.f / 256,   1.f / 512,  1.f / 1024, 1.f / 2048,
                                       1.f / 4096, 1.f / 8192, 1.f / 16384, 1.f / 32768};
  std::vector<Image> levels_;
};

}  // namespace mapmend::simulate

#include "libs/features/oriented_brief.h"

#include <cmath>
#include <numbers>

#include "libs/features/orb_pattern.h"
#include "libs/features/patch_kernels.h"

namespace mapmend {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// Rounds half up, with ties decided the same way whatever the last bit of the product.
int RoundStable(double v) { return static_cast<int>(std::floor(v + 0.5 + 1e-6)); }

}  // namespace

float PortableAtan2(float y, float x) {
  const float ax = std::abs(x), ay = std::abs(y);
  const float large = std::max(ax, ay), small = std::min(ax, ay);
  if (large == 0) return 0;
  // atan on [0, 1]: minimax polynomial in odd powers (Abramowitz and Stegun 4.4.49, |error| <= 1e-5).
  const float t = small / large, t2 = t * t;
  float angle = t * (0.9998660f + t2 * (-0.3302995f + t2 * (0.1801410f + t2 * (-0.0851330f + t2 * 0.0208351f))));
  if (ay > ax) angle = kPi / 2 - angle;
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

OrientedBrief::OrientedBrief() : offsets_(kNumAngles * 512) {
  constexpr int kCenter = PatchKernels::kBlurRadius * (PatchKernels::kBlurStride + 1);
  for (int a = 0; a < kNumAngles; ++a) {
    const double angle = 2 * std::numbers::pi * a / kNumAngles;
    const double c = std::cos(angle), s = std::sin(angle);
    for (int i = 0; i < 512; ++i) {
      const int x = kOrbPattern[2 * i], y = kOrbPattern[2 * i + 1];
      offsets_[a * 512 + i] = static_cast<int16_t>(kCenter + RoundStable(x * s + y * c) * PatchKernels::kBlurStride +
                                                   RoundStable(x * c - y * s));
    }
  }
}

Descriptor OrientedBrief::Describe(const uint8_t* patch, float angle) const {
  const float steps = angle * (kNumAngles / (2 * kPi));
  const int index = static_cast<int>(std::floor(steps + 0.5f)) & (kNumAngles - 1);
  const int16_t* offset = &offsets_[index * 512];
  Descriptor descriptor;
  for (uint64_t& word : descriptor) {
    uint64_t bits = 0;
    for (int bit = 0; bit < 64; ++bit, offset += 2) {
      bits |= static_cast<uint64_t>(patch[offset[0]] < patch[offset[1]]) << bit;
    }
    word = bits;
  }
  return descriptor;
}

}  // namespace mapmend

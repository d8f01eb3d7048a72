#include "libs/features/oriented_brief.h"

#include <cmath>
#include <numbers>

#include "libs/features/orb_pattern.h"

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

OrientedBrief::OrientedBrief() : rotated_(kNumAngles * 512) {
  for (int a = 0; a < kNumAngles; ++a) {
    const double angle = 2 * std::numbers::pi * a / kNumAngles;
    const double c = std::cos(angle), s = std::sin(angle);
    for (int i = 0; i < 512; ++i) {
      const int x = kOrbPattern[2 * i], y = kOrbPattern[2 * i + 1];
      rotated_[a * 512 + i] = {static_cast<int8_t>(RoundStable(x * c - y * s)),
                               static_cast<int8_t>(RoundStable(x * s + y * c))};
    }
  }
  for (int y = 0; y <= kRadius; ++y) {
    half_width_[y] = static_cast<int>(std::floor(std::sqrt(kRadius * kRadius - y * y + 1e-6)));
  }
}

float OrientedBrief::Angle(const uint8_t* center, int stride) const {
  int m10 = 0, m01 = 0;
  for (int y = -kRadius; y <= kRadius; ++y) {
    const uint8_t* row = center + y * stride;
    const int w = half_width_[std::abs(y)];
    int sum = 0;
    for (int x = -w; x <= w; ++x) {
      m10 += x * row[x];
      sum += row[x];
    }
    m01 += y * sum;
  }
  return PortableAtan2(static_cast<float>(m01), static_cast<float>(m10));
}

Descriptor OrientedBrief::Describe(const uint8_t* center, int stride, float angle) const {
  const float steps = angle * (kNumAngles / (2 * kPi));
  const int index = static_cast<int>(std::floor(steps + 0.5f)) & (kNumAngles - 1);
  const Offset* offset = &rotated_[index * 512];
  const auto value = [&](const Offset& o) { return center[o.y * stride + o.x]; };
  Descriptor descriptor;
  for (uint64_t& word : descriptor) {
    uint64_t bits = 0;
    for (int bit = 0; bit < 64; ++bit, offset += 2) {
      bits |= static_cast<uint64_t>(value(offset[0]) < value(offset[1])) << bit;
    }
    word = bits;
  }
  return descriptor;
}

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <vector>

#include "libs/features/features.h"

namespace mapmend {

// Orientation and descriptor of one patch. Immutable, thread-safe. Integer and plain float arithmetic only, so that
// every machine gives the same bits.
class OrientedBrief {
 public:
  static constexpr int kRadius = 15;       // of the disc whose centroid gives the orientation
  static constexpr int kPatchRadius = 19;  // furthest pixel read around a keypoint
  // Radians per step of the precomputed rotations: 2 pi / kNumAngles.
  static constexpr int kNumAngles = 512;

  OrientedBrief();

  // Direction from centre to intensity centroid of the disc of radius kRadius (ICCV 2011), radians in (-pi, pi].
  // center points to the keypoint's pixel of the unblurred pyramid level.
  float Angle(const uint8_t* center, int stride) const;

  // center points to the keypoint's pixel of the level blurred by a 7x7 Gaussian with sigma 2.
  Descriptor Describe(const uint8_t* center, int stride, float angle) const;

 private:
  struct Offset {
    int8_t x, y;
  };
  std::vector<Offset> rotated_;              // kNumAngles x 512
  std::array<int, kRadius + 1> half_width_;  // of the disc in row |y|
};

// atan2 by a polynomial, error below 1e-4 rad; unlike libm's the same bits everywhere.
float PortableAtan2(float y, float x);

}  // namespace mapmend

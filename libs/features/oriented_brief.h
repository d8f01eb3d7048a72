#pragma once

#include <cstdint>
#include <vector>

#include "libs/features/features.h"

namespace mapmend {

// Descriptor of one oriented patch. Immutable, thread-safe. The sampling pattern is rotated in steps of 2 pi /
// kNumAngles ahead of time; the same bits on every machine.
class OrientedBrief {
 public:
  static constexpr int kNumAngles = 512;

  OrientedBrief();

  // patch: pixels -19 .. 19 around the keypoint, as PatchKernels::blur_patch gives; angle in radians.
  Descriptor Describe(const uint8_t* patch, float angle) const;

 private:
  std::vector<int16_t> offsets_;  // kNumAngles x 512 positions in the patch
};

// atan2 by a polynomial, error below 1e-4 rad; unlike libm's the same bits everywhere.
float PortableAtan2(float y, float x);

}  // namespace mapmend

#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace mapmend {

// 256-bit ORB descriptor.
using Descriptor = std::array<uint64_t, 4>;

inline constexpr int kBeyondAnyDistance = 257;  // bits; descriptors have 256

// Number of differing bits, 0 to 256.
inline int HammingDistance(const Descriptor& a, const Descriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

struct Keypoint {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // of the ideal pinhole camera (undistorted)
  float angle = 0;                                  // radians, orientation of the patch
  int8_t octave = 0;                                // pyramid level, 0 = full resolution
};

// Features of one image; all vectors have the same length. colors may be empty.
struct Features {
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;
  std::vector<std::array<uint8_t, 3>> colors;  // red, green, blue

  int Size() const { return static_cast<int>(keypoints.size()); }
};

// The image pyramid of ORB: level o is smaller by scale_factor^o, and a pixel there is worth scale_factor^o pixels.
struct Pyramid {
  double scale_factor = 1.2;
  int num_levels = 8;

  double Scale(int octave) const;
  // Standard deviation of a keypoint position at this octave, pixels of level 0: Scale(octave).
  double Sigma(int octave) const { return Scale(octave); }
};

}  // namespace mapmend

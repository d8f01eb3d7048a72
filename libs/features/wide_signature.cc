#include "libs/features/wide_signature.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mapmend {
namespace {

constexpr double kFinestSizePx = 2;  // diameter of the smallest patches of SIFT: at level 0 of the pyramid

// A bit for each byte above the limit; the first 64 in the first word.
void Compare(const WideDescriptor& bytes, uint8_t limit, uint64_t* words) {
  for (size_t i = 0; i < bytes.size(); ++i) words[i / 64] |= uint64_t{bytes[i] > limit} << (i % 64);
}

Descriptor SignatureOf(const WideDescriptor& bytes) {
  WideDescriptor sorted = bytes;
  std::sort(sorted.begin(), sorted.end());
  Descriptor signature{};
  Compare(bytes, sorted[bytes.size() / 2 - 1], signature.data());
  Compare(bytes, sorted[bytes.size() * 3 / 4 - 1], signature.data() + 2);
  return signature;
}

int8_t OctaveOf(const WideKeypoint& keypoint, const Pyramid& pyramid) {
  const double level = std::log(keypoint.SizePx() / kFinestSizePx) / std::log(pyramid.scale_factor);
  return static_cast<int8_t>(std::clamp<long>(std::lround(level), 0, pyramid.num_levels - 1));
}

}  // namespace

Features SignaturesOf(const WideFeatures& wide, const Pyramid& pyramid) {
  Features features;
  for (const WideKeypoint& k : wide.keypoints) {
    const auto angle = static_cast<float>(2 * std::numbers::pi * k.angle / 256);
    features.keypoints.push_back({k.pixel, angle, OctaveOf(k, pyramid)});
  }
  for (const WideDescriptor& d : wide.descriptors) features.descriptors.push_back(SignatureOf(d));
  return features;
}

}  // namespace mapmend

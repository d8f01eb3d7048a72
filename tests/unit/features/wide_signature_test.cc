#include "libs/features/wide_signature.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libs/base/random.h"

namespace mapmend {
namespace wide_signature_test {

WideFeatures OneFeature(const WideDescriptor& descriptor) {
  WideFeatures wide;
  wide.keypoints.resize(1);
  wide.descriptors = {descriptor};
  return wide;
}

Descriptor SignatureOf(const WideDescriptor& descriptor) {
  return SignaturesOf(OneFeature(descriptor), {}).descriptors.at(0);
}

WideDescriptor RandomDescriptor(Random* random) {
  WideDescriptor descriptor;
  for (uint8_t& byte : descriptor) byte = static_cast<uint8_t>(random->Below(128));
  return descriptor;
}

TEST(WideSignature, AQuarterOfTheBytesIsAboveTheUpperQuartileAndHalfAboveTheMedian) {
  WideDescriptor descriptor;
  for (size_t i = 0; i < descriptor.size(); ++i) descriptor[i] = static_cast<uint8_t>((37 * i) % 128);  // each once
  const Descriptor signature = SignatureOf(descriptor);
  const Descriptor none{};
  EXPECT_EQ(HammingDistance(signature, none), 64 + 32);
  for (size_t i = 0; i < descriptor.size(); ++i) {
    EXPECT_EQ((signature[i / 64] >> (i % 64)) & 1, descriptor[i] > 63 ? 1U : 0U) << i;
    EXPECT_EQ((signature[2 + i / 64] >> (i % 64)) & 1, descriptor[i] > 95 ? 1U : 0U) << i;
  }
}

TEST(WideSignature, OfTheSameThingDifferInAFewBitsAndOfOthersInMany) {
  Random random(1);
  for (int trial = 0; trial < 100; ++trial) {
    const WideDescriptor descriptor = RandomDescriptor(&random), other = RandomDescriptor(&random);
    WideDescriptor again = descriptor;
    for (uint8_t& byte : again) byte = static_cast<uint8_t>(std::clamp<int>(byte + random.Below(17) - 8, 0, 127));
    EXPECT_LE(HammingDistance(SignatureOf(descriptor), SignatureOf(again)), 40);
    EXPECT_GE(HammingDistance(SignatureOf(descriptor), SignatureOf(other)), 64);
  }
}

TEST(WideSignature, SizesBecomeLevelsOfThePyramid) {
  WideFeatures wide = OneFeature({});
  WideKeypoint& keypoint = wide.keypoints[0];
  const Pyramid pyramid;
  const auto octave_of = [&](double size_px) {
    keypoint.size = static_cast<uint8_t>(std::lround(WideKeypoint::kSizesPerOctave * std::log2(size_px)));
    return int{SignaturesOf(wide, pyramid).keypoints.at(0).octave};
  };
  EXPECT_EQ(octave_of(1), 0);
  EXPECT_EQ(octave_of(2), 0) << "the finest that there are";
  EXPECT_EQ(octave_of(4), 4) << "1.2^4 is 2.07";
  EXPECT_EQ(octave_of(200), pyramid.num_levels - 1);
  keypoint.angle = 64;
  keypoint.pixel = {3, 4};
  const Keypoint turned = SignaturesOf(wide, pyramid).keypoints.at(0);
  EXPECT_NEAR(turned.angle, std::numbers::pi / 2, 1e-6);
  EXPECT_EQ(turned.pixel, keypoint.pixel);
}

}  // namespace wide_signature_test
}  // namespace mapmend

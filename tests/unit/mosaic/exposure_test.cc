#include "libs/mosaic/exposure.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/random.h"

namespace mapmend {
namespace exposure_test {

struct Case {
  std::vector<double> gains = {1.0, 1.3, 0.8, 1.1, 0.9};
  double a = -0.2, b = -0.1;
  std::vector<std::vector<BrightnessSample>> places;

  explicit Case(double wrong_share) {
    Random random(5);
    for (int p = 0; p < 400; ++p) {
      const double light = 60 + 80 * random.Uniform();
      std::vector<BrightnessSample> samples;
      for (int i = 0; i < 5; ++i) {
        if (random.Uniform() < 0.5) continue;
        const double r = random.Uniform(), r2 = r * r;
        double value = light * gains[i] * std::exp(a * r2 + b * r2 * r2);
        if (random.Uniform() < wrong_share) value = 30 + 150 * random.Uniform();  // something moved
        const auto v = static_cast<float>(value);
        samples.push_back({i, {v, v, v}, static_cast<float>(r)});
      }
      places.push_back(samples);
    }
  }
};

TEST(Exposure, GainsAndVignettingAreFoundUpToACommonFactor) {
  const Case truth(0);
  const Exposure found = SolveExposure(5, truth.places, {});
  for (int i = 1; i < 5; ++i)
    EXPECT_NEAR(found.gains[i][1] / found.gains[0][1], truth.gains[i] / truth.gains[0], 0.01) << i;
  EXPECT_NEAR(found.a + found.b, truth.a + truth.b, 0.03) << "darkening at the corner";
  double mean = 0;
  for (int i = 0; i < 5; ++i) mean += std::log(found.gains[i][1]) / 5;
  EXPECT_NEAR(mean, 0, 0.05) << "as bright as the images are on average";
}

TEST(Exposure, WhatDiffersForOtherReasonsDoesNotDecide) {
  const Case truth(0.1);
  const Exposure found = SolveExposure(5, truth.places, {});
  for (int i = 1; i < 5; ++i)
    EXPECT_NEAR(found.gains[i][0] / found.gains[0][0], truth.gains[i] / truth.gains[0], 0.05) << i;
}

TEST(Exposure, ClippedSamplesAndImagesWithoutOverlapStayAsTheyAre) {
  const std::vector<std::vector<BrightnessSample>> places = {{{0, {255, 255, 255}, 0}, {1, {100, 100, 100}, 0}}};
  const Exposure found = SolveExposure(3, places, {});
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(found.Correction(i, 0) / found.Vignetting(0.5F), 1, 1e-6);
}

}  // namespace exposure_test
}  // namespace mapmend

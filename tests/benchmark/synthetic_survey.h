#pragma once

#include <memory>
#include <random>
#include <vector>

#include "tests/synthetic_flight.h"

namespace mapmend::testing {

// A survey of strips at 100 m (750 m long, 60 m apart, an image every 30 m: 69 % forward and 53 % side overlap), some
// 800 features an image, a submap for every two strips, drift within submaps.
struct SyntheticSurvey {
  static constexpr int kPerStrip = 25;
  std::vector<TerrainPoint> terrain;
  std::unique_ptr<SyntheticFlight> flight;
};

inline std::unique_ptr<SyntheticSurvey> MakeSyntheticSurvey(const std::string& session, int num_keyframes) {
  constexpr int kPerStrip = SyntheticSurvey::kPerStrip;
  constexpr double kAlong = 30, kAcross = 60, kMargin = 100;
  auto survey = std::make_unique<SyntheticSurvey>();
  const int num_strips = num_keyframes / kPerStrip;
  TerrainOptions terrain;
  terrain.width = 2 * kMargin + kAlong * kPerStrip;
  terrain.height = 2 * kMargin + kAcross * num_strips;
  terrain.num_points = static_cast<int>(0.08 * terrain.width * terrain.height);
  survey->terrain = MakeTerrain(terrain);
  FlightOptions options;
  options.scale_drift = 0.0005;
  options.angle_drift_deg = 0.03;
  survey->flight = std::make_unique<SyntheticFlight>(session, 0, survey->terrain, options);
  std::mt19937_64 random(5);
  std::vector<Rigid3> poses;
  for (int s = 0; s < num_strips; ++s) {
    const double y = kMargin + kAcross * s, near = kMargin, far = kMargin + kAlong * (kPerStrip - 1);
    const auto strip = s % 2 ? Strip({far, y}, {near, y}, 100, kPerStrip, 270, &random)
                             : Strip({near, y}, {far, y}, 100, kPerStrip, 90, &random);
    poses.insert(poses.end(), strip.begin(), strip.end());
    if (s % 2 == 0) continue;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.3 * s, Eigen::Vector3d(1, 2, -1).normalized()));
    survey->flight->AddSubmap(poses, Similarity3(0.02 + 0.001 * s, turn, {3, -2, 7}));
    poses.clear();
  }
  survey->flight->End();
  return survey;
}

}  // namespace mapmend::testing

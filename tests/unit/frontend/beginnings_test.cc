// Beginnings over planes, near planes and rough ground, by a camera that turns while it hardly moves: what is believed
// is right. MAPMEND_BEGINNINGS sets their number (default 60).

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <vector>

#include "libs/geometry/alignment.h"
#include "procs/frontend/initializer.h"
#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace {

constexpr double kNoise = 1;  // pixels

struct Beginning {
  bool is_uncertain = false;
  double error = 0;     // of the second camera's place, of the baseline
  double baseline = 0;  // of the depth
};

// One that lies so far off, when its points are aligned to the true ones.
double Error(const SyntheticScene& scene, const std::vector<Rigid3>& poses, const Initialization& result) {
  const Rigid3 &first = poses[result.first->index], &second = poses[result.second->index];
  const std::vector<Eigen::Vector3d> shown = scene.Shown(result.first->index);
  std::vector<Eigen::Vector3d> found, truth;
  for (const InitialPoint& p : result.points) {
    found.push_back(p.position);
    truth.push_back(first * shown[p.first_feature]);
  }
  const Similarity3 aligned = AlignPoints(found, truth, AlignmentKind::kSimilarity).to_from_source;
  const Eigen::Vector3d center = (second * first.Inverse()).Center();
  return (aligned * result.second_from_first.Center() - aligned * Eigen::Vector3d(0, 0, 0) - center).norm() /
         center.norm();
}

// A flight that begins slowly: the baseline grows from nothing to four times what is given.
std::optional<Beginning> Begin(double relief, double baseline, int trial) {
  SyntheticScene scene(1400, -2, 2, relief, 900 + trial);
  Initializer initializer({}, scene.Camera(), {});
  Random random(trial);
  const auto direction = [&] {
    return Eigen::Vector3d(random.Uniform() - 0.5, random.Uniform() - 0.5, random.Uniform() - 0.5).normalized();
  };
  const Eigen::Vector3d axis = direction(), step = direction();
  const double turn = 0.15 * random.Uniform();
  const Eigen::AngleAxisd tilt(0.5 * random.Uniform(), direction());
  std::vector<Rigid3> poses;
  for (const double share : {0.0, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0}) {
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(turn * share, axis) * tilt);
    poses.push_back(Rigid3(turned, Eigen::Vector3d::Zero()) * NadirPose(0, 0));
    poses.back() = poses.back() * Rigid3(Eigen::Quaterniond::Identity(), -baseline * share * step);
    const auto index = static_cast<int>(poses.size()) - 1;
    const Initialization result = initializer.AddFrame(scene.View(poses.back(), index, kNoise));
    if (!result.success) continue;
    return Beginning{result.is_uncertain, Error(scene, poses, result),
                     (poses[result.second->index] * poses[result.first->index].Inverse()).Center().norm()};
  }
  return std::nullopt;
}

TEST(Beginnings, WhatIsBelievedIsRight) {
  const char* wish = std::getenv("MAPMEND_BEGINNINGS");
  const int count = wish != nullptr ? std::atoi(wish) : 60;
  int begun = 0, bad = 0, uncertain = 0;
  for (int trial = 0; trial < count; ++trial) {
    const double relief = std::array{0.0, 0.02, 0.1, 0.3}[trial % 4];
    const double baseline = 0.02 + 0.08 * (trial / 4 % 5) / 4;
    const std::optional<Beginning> beginning = Begin(relief, baseline, trial);
    if (!beginning) continue;
    ++begun;
    uncertain += beginning->is_uncertain;
    if (beginning->error <= 0.15) continue;
    ++bad;
    std::printf("bad: trial %d, relief %.2f, baseline %.3f of the depth: error %.2f of it\n", trial, relief,
                beginning->baseline, beginning->error);
  }
  std::printf("%d beginnings, %d begun, %d bad, %d uncertain\n", count, begun, bad, uncertain);
  EXPECT_GE(begun, 0.8 * count);
  EXPECT_LE(bad, 0.01 * count);
}

}  // namespace
}  // namespace mapmend

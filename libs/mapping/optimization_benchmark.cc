// Pose optimisation and local bundle adjustment, one thread, on exact synthetic geometry with pixel noise: a camera
// that looks straight down from 10 units and flies over rolling ground. "error" is what is left of the error put into
// the position, in thousandths of the height above ground.

#include <benchmark/benchmark.h>

#include <random>

#include "libs/mapping/bundle_adjustment.h"
#include "libs/mapping/pose_optimization.h"

namespace mapmend {
namespace {

const Pinhole kCamera{480, 480, 400, 300, 800, 600};
constexpr double kHeight = 10, kStep = 1.2;  // 53 pixels between keyframes, as the bundled flight

double Uniform(std::mt19937_64* rng, double low, double high) {
  return low + (high - low) * static_cast<double>((*rng)() >> 11) * 0x1.0p-53;
}

Eigen::Vector3d Noise(std::mt19937_64* rng, double size) {
  return {Uniform(rng, -size, size), Uniform(rng, -size, size), Uniform(rng, -size, size)};
}

bool IsVisible(const Eigen::Vector3d& x_cam, Eigen::Vector2d* pixel) {
  if (x_cam.z() <= 0) return false;
  *pixel = kCamera.Project(x_cam);
  return pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < kCamera.width && pixel->y() < kCamera.height;
}

Rigid3 Perturbed(const Rigid3& pose, double degrees, double shift, std::mt19937_64* rng) {
  const Eigen::Vector3d turn = Noise(rng, degrees * M_PI / 180);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return Rigid3(rotation, Noise(rng, shift)) * pose;
}

// Arguments: points, outliers in percent.
void PoseOptimization(benchmark::State& state) {
  std::mt19937_64 rng(1);
  const Rigid3 truth(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX())), {0.3, -0.2, 0.1});
  std::vector<PoseObservation> observations;
  while (static_cast<int64_t>(observations.size()) < state.range(0)) {
    const Eigen::Vector3d x_cam =
        kCamera.Unproject({Uniform(&rng, 0, 800), Uniform(&rng, 0, 600)}) * Uniform(&rng, 8, 12);
    Eigen::Vector2d pixel =
        kCamera.Project(x_cam) + Eigen::Vector2d(Uniform(&rng, -1.5, 1.5), Uniform(&rng, -1.5, 1.5));
    if (Uniform(&rng, 0, 100) < static_cast<double>(state.range(1)))
      pixel = {Uniform(&rng, 0, 800), Uniform(&rng, 0, 600)};
    observations.push_back({truth.Inverse() * x_cam, pixel, 1.0});
  }
  const Rigid3 start = Perturbed(truth, 2, 0.2, &rng);
  PoseOptimizationResult result;
  for (auto _ : state) result = OptimizePose(kCamera, start, observations, {});
  if (!result.success) state.SkipWithError("no pose");
  state.counters["inliers"] = result.num_inliers;
  state.counters["error"] = 1000 / kHeight * (result.cam_from_world.Center() - truth.Center()).norm();
}

// Arguments: keyframes, points per keyframe, how many of them determine its pose (0: all). A third of the keyframes is
// fixed, as the rim of the local window is.
void LocalBundleAdjustment(benchmark::State& state) {
  std::mt19937_64 rng(1);
  const int num_keyframes = static_cast<int>(state.range(0));
  std::vector<Rigid3> truth;
  BundleProblem start;
  start.cameras = {kCamera};
  for (int i = 0; i < num_keyframes; ++i) {
    // x right, y down in the image; the camera looks along +z, the ground is at z = kHeight.
    truth.push_back(Rigid3(Eigen::Quaterniond::Identity(), {-kStep * i, 0, 0}));
    const bool fixed = i < num_keyframes / 3;
    start.poses.push_back({fixed ? truth.back() : Perturbed(truth.back(), 0.3, 0.05, &rng), fixed, 0});
  }
  const double length = kStep * num_keyframes + 800.0 / kCamera.fx * kHeight;
  const auto num_points =
      static_cast<int>(static_cast<double>(state.range(1)) * length / (800.0 / kCamera.fx * kHeight));
  std::vector<Eigen::Vector3d> points;
  for (int p = 0; p < num_points; ++p) {
    const double x = Uniform(&rng, -8, length - 8), y = Uniform(&rng, -6, 6);
    const Eigen::Vector3d point(x, y, kHeight + 0.5 * std::sin(x) * std::cos(y));
    std::vector<BundleObservation> seen;
    for (int i = 0; i < num_keyframes; ++i) {
      Eigen::Vector2d pixel;
      if (!IsVisible(truth[i] * point, &pixel) || Uniform(&rng, 0, 1) < 0.3) continue;
      pixel += Eigen::Vector2d(Uniform(&rng, -1.5, 1.5), Uniform(&rng, -1.5, 1.5));
      seen.push_back({i, static_cast<int>(points.size()), pixel, 1.0});
    }
    if (seen.size() < 2) continue;
    start.observations.insert(start.observations.end(), seen.begin(), seen.end());
    points.push_back(point);
    start.points.push_back(point + Noise(&rng, 0.1));
  }
  BundleOptions options;
  options.points_per_pose = static_cast<int>(state.range(2));
  BundleProblem problem;
  BundleSummary summary;
  for (auto _ : state) {
    problem = start;
    summary = AdjustBundle(options, &problem);
  }
  if (!summary.success) state.SkipWithError("no solution");
  double squares = 0;
  for (int i = 0; i < num_keyframes; ++i) {
    squares += (problem.poses[i].cam_from_world.Center() - truth[i].Center()).squaredNorm();
  }
  state.counters["points"] = static_cast<double>(points.size());
  state.counters["observations"] = static_cast<double>(start.observations.size());
  state.counters["iterations"] = summary.iterations;
  state.counters["error"] = 1000 / kHeight * std::sqrt(squares / num_keyframes);
}

BENCHMARK(PoseOptimization)
    ->ArgNames({"points", "outliers"})
    ->ArgsProduct({{100, 300, 1000}, {0, 20}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(LocalBundleAdjustment)
    ->ArgNames({"keyframes", "points", "chosen"})
    ->ArgsProduct({{10, 20}, {300, 600}, {0, 150}})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();

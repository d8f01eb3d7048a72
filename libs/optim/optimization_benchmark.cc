// Pose optimisation and local bundle adjustment, one thread, on exact synthetic geometry with pixel noise: a camera
// that looks straight down from 10 units and flies over rolling ground. "error" is what is left of the error put into
// the position, in thousandths of the height above ground.

#include <benchmark/benchmark.h>

#include <random>

#include "libs/optim/bundle_adjuster.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_optimization.h"

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

// A flight along x, straight ahead over the ground, as it is and as it is known before bundle adjustment.
struct Strip {
  std::vector<Rigid3> truth;  // of the poses
  BundleProblem start;        // all poses free
};

Strip MakeStrip(int num_keyframes, int num_exact, int64_t points_per_keyframe) {
  std::mt19937_64 rng(1);
  Strip strip;
  strip.start.cameras = {kCamera};
  for (int i = 0; i < num_keyframes; ++i) {
    // x right, y down in the image; the camera looks along +z, the ground is at z = kHeight.
    strip.truth.push_back(Rigid3(Eigen::Quaterniond::Identity(), {-kStep * i, 0, 0}));
    const Rigid3& truth = strip.truth.back();
    strip.start.poses.push_back({i < num_exact ? truth : Perturbed(truth, 0.3, 0.05, &rng), false, 0});
  }
  const double length = kStep * num_keyframes + 800.0 / kCamera.fx * kHeight;
  const auto num_points =
      static_cast<int>(static_cast<double>(points_per_keyframe) * length / (800.0 / kCamera.fx * kHeight));
  for (int p = 0; p < num_points; ++p) {
    const double x = Uniform(&rng, -8, length - 8), y = Uniform(&rng, -6, 6);
    const Eigen::Vector3d point(x, y, kHeight + 0.5 * std::sin(x) * std::cos(y));
    std::vector<BundleObservation> seen;
    for (int i = 0; i < num_keyframes; ++i) {
      Eigen::Vector2d pixel;
      if (!IsVisible(strip.truth[i] * point, &pixel) || Uniform(&rng, 0, 1) < 0.3) continue;
      pixel += Eigen::Vector2d(Uniform(&rng, -1.5, 1.5), Uniform(&rng, -1.5, 1.5));
      seen.push_back({i, static_cast<int>(strip.start.points.size()), pixel, 1.0});
    }
    if (seen.size() < 2) continue;
    strip.start.observations.insert(strip.start.observations.end(), seen.begin(), seen.end());
    strip.start.points.push_back(point + Noise(&rng, 0.1));
  }
  return strip;
}

// Arguments: keyframes, points per keyframe, how many of them determine its pose (0: all). A third of the keyframes is
// fixed, as the rim of the local window is.
void LocalBundleAdjustment(benchmark::State& state) {
  const int num_keyframes = static_cast<int>(state.range(0));
  Strip strip = MakeStrip(num_keyframes, num_keyframes / 3, state.range(1));
  for (int i = 0; i < num_keyframes / 3; ++i) strip.start.poses[i].fixed = true;
  BundleOptions options;
  options.points_per_pose = static_cast<int>(state.range(2));
  BundleProblem problem;
  BundleSummary summary;
  for (auto _ : state) {
    problem = strip.start;
    summary = AdjustBundle(options, &problem);
  }
  if (!summary.success) state.SkipWithError("no solution");
  double squares = 0;
  for (int i = 0; i < num_keyframes; ++i) {
    squares += (problem.poses[i].cam_from_world.Center() - strip.truth[i].Center()).squaredNorm();
  }
  state.counters["points"] = static_cast<double>(strip.start.points.size());
  state.counters["observations"] = static_cast<double>(strip.start.observations.size());
  state.counters["iterations"] = summary.iterations;
  state.counters["error"] = 1000 / kHeight * std::sqrt(squares / num_keyframes);
}

// Arguments: as above, and whether one adjuster serves all windows. The window moves on by one keyframe each time, at
// the end of the strip it starts again; the time is that of one window.
void MovingWindow(benchmark::State& state) {
  constexpr int kStripLength = 60;
  const int num_keyframes = static_cast<int>(state.range(0));
  const Strip strip = MakeStrip(kStripLength, 0, state.range(1));
  struct Window {
    BundleProblem problem;
    std::vector<int> points;
  };
  std::vector<Window> windows;
  for (int first = 0; first + num_keyframes <= kStripLength; ++first) {
    Window window;
    window.problem.cameras = strip.start.cameras;
    for (int i = 0; i < num_keyframes; ++i) {
      const bool fixed = i < num_keyframes / 3;
      window.problem.poses.push_back(
          {fixed ? strip.truth[first + i] : strip.start.poses[first + i].cam_from_world, fixed, 0});
    }
    for (const BundleObservation& o : strip.start.observations) {
      if (o.pose < first || o.pose >= first + num_keyframes) continue;
      if (window.points.empty() || window.points.back() != o.point) {
        window.points.push_back(o.point);
        window.problem.points.push_back(strip.start.points[o.point]);
      }
      const int point = static_cast<int>(window.points.size()) - 1;
      window.problem.observations.push_back({o.pose - first, point, o.pixel, o.sigma});
    }
    windows.push_back(std::move(window));
  }
  BundleOptions options;
  options.max_iterations = 5;
  options.points_per_pose = static_cast<int>(state.range(2));
  BundleAdjuster adjuster;
  size_t next = 0;
  for (auto _ : state) {
    BundleProblem problem = windows[next].problem;
    const bool success =
        (state.range(3) != 0 ? adjuster.Adjust(options, &problem) : AdjustBundle(options, &problem)).success;
    if (!success) state.SkipWithError("no solution");
    next = (next + 1) % windows.size();
  }
}

BENCHMARK(PoseOptimization)
    ->ArgNames({"points", "outliers"})
    ->ArgsProduct({{100, 300, 1000}, {0, 20}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(LocalBundleAdjustment)
    ->ArgNames({"keyframes", "points", "chosen"})
    ->ArgsProduct({{10, 20}, {300, 600}, {0, 150}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(MovingWindow)
    ->ArgNames({"keyframes", "points", "chosen", "keep"})
    ->ArgsProduct({{20, 32}, {600}, {0, 150}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();

#include "libs/optim/bundle_adjuster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/shuffled_heap.h"

namespace mapmend {
namespace bundle_adjuster_test {

const Pinhole kCamera{480, 470, 400, 300, 800, 600};
constexpr int kPoses = 24, kPoints = 700;

double Uniform(std::mt19937_64* rng, double low, double high) {
  return low + (high - low) * static_cast<double>((*rng)() >> 11) * 0x1.0p-53;
}

// A flight over rolling ground as the frontend maps it: what is known of poses and points changes from window to
// window, observations are dropped, move to another pixel and come back, points and keyframes go for good.
class Flight {
 public:
  Flight() {
    for (int i = 0; i < kPoses; ++i) {
      const Rigid3 world_from_cam(Eigen::Quaterniond(Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d::UnitX())),
                                  {0.15 * i, 0.02 * i, -1.0});
      poses_.push_back(world_from_cam.Inverse());
    }
    for (int i = 0; i < kPoints; ++i)
      points_.emplace_back(Uniform(&rng_, -0.5, 4), Uniform(&rng_, -0.5, 0.5), Uniform(&rng_, -0.1, 0.1));
    gone_.assign(kPoints, false);
    pixels_.assign(kPoses, std::vector<Eigen::Vector2d>(kPoints, {-1, -1}));
    for (int i = 0; i < kPoses; ++i) {
      for (int p = 0; p < kPoints; ++p) Observe(i, p);
      poses_[i].translation += Eigen::Vector3d::Constant(Uniform(&rng_, -0.01, 0.01));
    }
  }

  // The window that ends with a pose: eight free ones, up to five fixed, two of them from long ago.
  BundleProblem Window(int last, std::vector<int>* pose_ids, std::vector<int>* point_ids) const {
    BundleProblem problem;
    problem.cameras = {kCamera};
    pose_ids->clear(), point_ids->clear();
    const auto add = [&](int i, bool fixed) {
      if (i < 0 || i == kCulled || std::count(pose_ids->begin(), pose_ids->end(), i) > 0) return;
      pose_ids->push_back(i);
      problem.poses.push_back({poses_[i], fixed, 0});
    };
    for (int i = last; i > last - 8; --i) add(i, i < 2);
    for (int i = last - 8; i > last - 11; --i) add(i, true);
    add(last % 3, true), add(1, true);
    for (int p = 0; p < kPoints; ++p) {
      std::vector<BundleObservation> seen;
      for (size_t i = 0; i < pose_ids->size(); ++i) {
        const Eigen::Vector2d& pixel = pixels_[(*pose_ids)[i]][p];
        if (pixel.x() >= 0)
          seen.push_back({static_cast<int>(i), static_cast<int>(point_ids->size()), pixel, 1 + 0.2 * (p % 3)});
      }
      if (gone_[p] || seen.size() < 2) continue;
      point_ids->push_back(p);
      problem.points.push_back(points_[p]);
      problem.observations.insert(problem.observations.end(), seen.begin(), seen.end());
    }
    return problem;
  }

  void TakeOver(const BundleProblem& problem, const std::vector<int>& pose_ids, const std::vector<int>& point_ids) {
    for (size_t i = 0; i < pose_ids.size(); ++i) poses_[pose_ids[i]] = problem.poses[i].cam_from_world;
    for (size_t p = 0; p < point_ids.size(); ++p) points_[point_ids[p]] = problem.points[p];
  }

  void Change() {
    for (int change = 0; change < 200; ++change) {
      const int pose = static_cast<int>(Uniform(&rng_, 0, kPoses)),
                point = static_cast<int>(Uniform(&rng_, 0, kPoints));
      if (change % 3 == 0) Observe(pose, point);
      if (change % 3 == 1) pixels_[pose][point] = {-1, -1};
      if (change % 20 == 2) gone_[point] = true;
    }
  }

 private:
  static constexpr int kCulled = 7;

  void Observe(int pose, int point) {
    const Eigen::Vector3d x = poses_[pose] * points_[point];
    Eigen::Vector2d pixel = kCamera.Project(x) + Eigen::Vector2d(Uniform(&rng_, -1, 1), Uniform(&rng_, -1, 1));
    if (x.z() < 0.1 || pixel.x() < 0 || pixel.y() < 0 || pixel.x() > 800 || pixel.y() > 600) pixel = {-1, -1};
    pixels_[pose][point] = pixel;
  }

  std::mt19937_64 rng_{7};
  std::vector<Rigid3> poses_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<bool> gone_;
  std::vector<std::vector<Eigen::Vector2d>> pixels_;  // of each pose, each point; negative: not seen
};

double Difference(const BundleProblem& a, const BundleProblem& b) {
  double largest = 0;
  for (size_t i = 0; i < a.poses.size(); ++i) {
    const Rigid3 &p = a.poses[i].cam_from_world, &q = b.poses[i].cam_from_world;
    largest =
        std::max({largest, (p.translation - q.translation).norm(), RotationAngle(p.rotation * q.rotation.conjugate())});
  }
  for (size_t i = 0; i < a.points.size(); ++i) largest = std::max(largest, (a.points[i] - b.points[i]).norm());
  return largest;
}

// All points, then a part of them; the windows grow and shrink, and what is fixed in one is free in the next.
TEST(BundleAdjuster, EqualsAnAdjustmentOnItsOwnWhileTheWindowMoves) {
  Flight flight;
  BundleAdjuster adjuster;
  for (int last = 5; last < 2 * kPoses; ++last) {
    BundleOptions options;
    options.points_per_pose = last < kPoses ? 0 : 96;
    std::vector<int> poses, points;
    const BundleProblem start = flight.Window(last % kPoses, &poses, &points);
    BundleProblem one = start, own = start;
    const BundleSummary summary = adjuster.Adjust(options, &one);
    const BundleSummary expected = AdjustBundle(options, &own);
    ASSERT_EQ(summary.success, expected.success);
    EXPECT_EQ(summary.initial_cost, expected.initial_cost);
    EXPECT_EQ(summary.final_cost, expected.final_cost);
    EXPECT_EQ(Difference(one, own), 0) << last;
    if (poses.size() > 4) {
      ASSERT_TRUE(summary.success);
      EXPECT_LT(summary.final_cost, summary.initial_cost);
      EXPECT_GT(Difference(one, start), 1e-4);
    }
    flight.TakeOver(one, poses, points);
    flight.Change();
  }
}

// The readout times of two cameras are unknowns too. Equal input gives equal bits, wherever its unknowns lie in memory.
TEST(BundleAdjuster, DoesNotDependOnAddresses) {
  std::vector<int> poses, points;
  BundleProblem start = Flight().Window(17, &poses, &points);
  start.cameras = {kCamera, kCamera};
  start.readout_of_camera = {0, 1};
  start.readouts = {0.0, 0.0};
  for (size_t i = 0; i < start.poses.size(); ++i) start.poses[i].camera = static_cast<int>(i % 2);
  for (const BundleObservation& o : start.observations)
    start.shutter_correction.emplace_back(30.0 + o.pose, static_cast<float>(o.point % 7));
  BundleProblem first = start;
  ASSERT_TRUE(AdjustBundle({}, &first).success);
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const testing::ShuffledHeap heap(seed);
    BundleProblem again = start;
    ASSERT_TRUE(AdjustBundle({}, &again).success);
    EXPECT_EQ(Difference(first, again), 0) << seed;
    EXPECT_EQ(first.readouts, again.readouts) << seed;
  }
}

TEST(BundleAdjuster, AWindowWithoutObservationsChangesNothing) {
  std::vector<int> poses, points;
  Flight flight;
  BundleAdjuster adjuster;
  BundleProblem problem = flight.Window(9, &poses, &points);
  ASSERT_TRUE(adjuster.Adjust({}, &problem).success);
  BundleProblem empty;
  empty.points.emplace_back(1, 2, 3);
  EXPECT_FALSE(adjuster.Adjust({}, &empty).success);
  EXPECT_EQ(empty.points[0], Eigen::Vector3d(1, 2, 3));
  BundleProblem again = flight.Window(12, &poses, &points), own = again;
  ASSERT_TRUE(adjuster.Adjust({}, &again).success);
  ASSERT_TRUE(AdjustBundle({}, &own).success);
  EXPECT_EQ(Difference(again, own), 0);
}

}  // namespace bundle_adjuster_test
}  // namespace mapmend

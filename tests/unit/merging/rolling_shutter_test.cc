#include "libs/merging/rolling_shutter.h"

#include <gtest/gtest.h>

#include "libs/geometry/sim3_closed_form.h"
#include "libs/merging/merged_refinement.h"
#include "libs/optim/reprojection_cost.h"
#include "tests/merger_fixture.h"
#include "tests/shuffled_heap.h"

namespace mapmend {
namespace rolling_shutter_test {

using testing::FlightOptions;
using testing::NadirPose;
using testing::SyntheticFlight;
using testing::Terrain;

// Four strips there and back, side by side, 14 m a second, 100 m above the ground.
std::vector<Rigid3> Survey() {
  std::vector<Rigid3> poses;
  for (int strip = 0; strip < 4; ++strip) {
    for (int i = 0; i < 12; ++i) {
      const double along = 14.0 * (strip % 2 ? 11 - i : i);
      poses.push_back(NadirPose(100 + along, 100 + 35.0 * strip, 100, 0));
    }
  }
  return poses;
}

struct Refined {
  Shutter shutter;
  double error = 0;  // RMS of the camera centres after the best similarity, metres
  std::string told;
};

// turned: the camera is held upright, and reads columns.
Refined Refine(double readout, bool find, bool turned = false) {
  FlightOptions flight_options;
  flight_options.readout = readout;
  flight_options.reads_columns = turned;
  flight_options.pixel_noise = 0.3;
  SyntheticFlight flight("s", 0, Terrain(), flight_options);
  flight.AddSubmap(Survey(), testing::Frame(0.02, 0.4));
  const Session session = flight.Model();
  MergedRefinementOptions options;
  options.shutter.use = find;
  Refined refined;
  const MergedRefinementResult result = RefineMergedMap({testing::ViewOf(session, 0)}, {Similarity3()}, {}, options,
                                                        [&](const std::string& what) { refined.told += what + "\n"; });
  EXPECT_TRUE(result.summary.success) << result.summary.reason;
  refined.shutter = result.map.shutters[0];
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const MergedKeyframe& k : result.map.keyframes) {
    estimated.push_back(k.cam_from_root.Center());
    truth.push_back(flight.world_from_keyframe()[k.keyframe->id.value].translation);
  }
  const Similarity3 t = *HornAlignment(estimated, truth);
  for (size_t i = 0; i < truth.size(); ++i) refined.error += (t * estimated[i] - truth[i]).squaredNorm();
  refined.error = std::sqrt(refined.error / static_cast<double>(truth.size()));
  return refined;
}

TEST(RollingShutter, IsFoundAndTakenOutOfTheMap) {
  const Refined at_once = Refine(0, true), bent = Refine(0.03, false), mended = Refine(0.03, true);
  EXPECT_EQ(at_once.shutter.readout, 0) << at_once.told;
  EXPECT_EQ(bent.shutter.readout, 0);
  EXPECT_NEAR(mended.shutter.readout, 0.03, 0.002) << mended.told;
  RecordProperty("at_once_mm", static_cast<int>(1000 * at_once.error));
  RecordProperty("bent_mm", static_cast<int>(1000 * bent.error));
  RecordProperty("mended_mm", static_cast<int>(1000 * mended.error));
  EXPECT_GT(bent.error, 2.5 * at_once.error);
  EXPECT_LT(mended.error, 1.5 * at_once.error);
}

// To the bit, wherever things lie in memory.
TEST(RollingShutter, TheSameMapWhateverTheAllocatorDoes) {
  const Refined first = Refine(0.03, true);
  for (const uint64_t seed : {1, 2, 3}) {
    const testing::ShuffledHeap heap(seed);
    const Refined again = Refine(0.03, true);
    EXPECT_EQ(first.shutter.readout, again.shutter.readout) << seed;
    EXPECT_EQ(first.error, again.error) << seed;
  }
}

TEST(RollingShutter, OfACameraUpsideDownReadsTheOtherWay) {
  EXPECT_NEAR(Refine(-0.03, true).shutter.readout, -0.03, 0.002);
}

TEST(RollingShutter, OfACameraHeldUprightReadsColumns) {
  const Refined at_once = Refine(0, true), mended = Refine(0.03, true, true), bent = Refine(0.03, false, true);
  EXPECT_EQ(mended.shutter.lines, ScanLines::kColumns) << mended.told;
  EXPECT_NEAR(mended.shutter.readout, 0.03, 0.002) << mended.told;
  EXPECT_GT(bent.error, 1.5 * mended.error);
  EXPECT_LT(mended.error, 1.5 * at_once.error);
  EXPECT_EQ(Refine(0.03, true).shutter.lines, ScanLines::kRows);
}

// A camera that moves and turns at constant speed; features as the rows were read, exactly.
TEST(RollingShutter, CorrectionMovesAPixelToWhereItWouldBeAtTheMiddleRow) {
  const Pinhole camera{500, 480, 320, 240, 640, 480};
  const CameraMotion motion{{0.4, -0.2, 0.1}, {0.05, 0.1, -0.2}};
  constexpr double kReadout = 0.03;
  for (const Eigen::Vector3d& x :
       {Eigen::Vector3d(1, 0.8, 2), Eigen::Vector3d(-2, -1.5, 4), Eigen::Vector3d(0, 2, 5)}) {
    const auto pixel_at = [&](double t) {
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(t * motion.turn_rate.norm(), motion.turn_rate.normalized()));
      return camera.Project(turned.conjugate() * (x - t * motion.velocity));
    };
    Eigen::Vector2d read = camera.Project(x);
    for (int i = 0; i < 10; ++i) read = pixel_at(kReadout * (read.y() / camera.height - 0.5));
    const double row = LinePlace(camera, {}, read, ScanLines::kRows);
    const Eigen::Vector2d corrected = read + kReadout * ShutterCorrection(camera, motion, x, row);
    EXPECT_GT((read - camera.Project(x)).norm(), 0.3);
    EXPECT_LT((corrected - camera.Project(x)).norm(), 0.01);
  }
  EXPECT_EQ(ShutterCorrection(camera, motion, {1, 1, 0}, 0.5), Eigen::Vector2d::Zero());
  EXPECT_EQ(ShutterCorrection(camera, motion, {1, 1, -2}, 0.5), Eigen::Vector2d::Zero());
}

TEST(RollingShutter, RowsAreThoseOfTheRealImage) {
  Camera real;
  real.width = 640, real.height = 480;
  real.fx = real.fy = 500, real.cx = 320, real.cy = 240;
  EXPECT_DOUBLE_EQ(LinePlace(real.Ideal(), real, {100, 120}, ScanLines::kRows), -0.25);
  real.distortion[0] = -0.2;
  // The ideal pixel of a feature in the real row 0.
  const Eigen::Vector2f ideal = real.Undistort({{600, 0}})[0];
  EXPECT_LT(ideal.y(), -5);
  EXPECT_NEAR(LinePlace(real.Ideal(), real, ideal.cast<double>(), ScanLines::kRows), -0.5, 1e-3);
}

TEST(RollingShutter, MotionComesFromTheFramesBeforeAndAfter) {
  Submap submap;
  // 2 units a second along x, turning by 0.1 radians a second about z; frames every 0.1 s, then a gap.
  const auto pose_at = [](double t) {
    return Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * t, Eigen::Vector3d::UnitZ())), {2 * t, 0, 0}).Inverse();
  };
  for (const int tick : {0, 1, 2, 3, 20}) {
    SubmapKeyframe& k = submap.keyframes[KeyframeId(tick)];
    k.id = KeyframeId(tick);
    k.utime = 100000 * tick;
    k.cam_from_submap = pose_at(0.1 * tick);
  }
  const std::vector<CameraMotion> motions = KeyframeMotions(submap);
  ASSERT_EQ(motions.size(), 5u);
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d along = pose_at(0.1 * i).rotation * Eigen::Vector3d(2, 0, 0);
    EXPECT_LT((motions[i].velocity - along).norm(), 1e-9) << i;
    EXPECT_LT((motions[i].turn_rate - Eigen::Vector3d(0, 0, 0.1)).norm(), 1e-9) << i;
  }
  EXPECT_EQ(motions[4].velocity, Eigen::Vector3d::Zero());  // 1.7 s from any other
}

TEST(RollingShutter, JacobiansAreThoseOfDifferences) {
  const Pinhole camera{500, 480, 320, 240, 640, 480};
  SteppedPoses poses({Rigid3(Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized(), {0.3, -0.2, 4})});
  Eigen::Vector3d point(0.4, 0.3, 0.8);
  double readout = 0.02;
  const RollingShutterCost cost(camera, poses.At(0), {300, 200}, 1.7, {35, -80});
  const double* parameters[] = {poses.Step(0), point.data(), &readout};
  const auto evaluate = [&] {
    poses.PrepareForEvaluation(false, true);
    Eigen::Vector2d r;
    EXPECT_TRUE(cost.Evaluate(parameters, r.data(), nullptr));
    return r;
  };
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  Eigen::Vector2d by_readout, residual;
  double* jacobians[] = {by_pose.data(), by_point.data(), by_readout.data()};
  poses.PrepareForEvaluation(true, true);
  ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
  const auto difference = [&](double* value) {
    constexpr double kStep = 1e-6;
    const double start = *value;
    *value = start + kStep;
    const Eigen::Vector2d up = evaluate();
    *value = start - kStep;
    const Eigen::Vector2d down = evaluate();
    *value = start;
    return Eigen::Vector2d((up - down) / (2 * kStep));
  };
  for (int i = 0; i < 6; ++i) EXPECT_LT((difference(poses.Step(0) + i) - by_pose.col(i)).norm(), 1e-4) << i;
  for (int i = 0; i < 3; ++i) EXPECT_LT((difference(&point[i]) - by_point.col(i)).norm(), 1e-4) << i;
  EXPECT_LT((difference(&readout) - by_readout).norm(), 1e-4);
}

}  // namespace rolling_shutter_test
}  // namespace mapmend

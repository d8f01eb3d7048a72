#include "libs/geometry/alignment.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapmend {
namespace alignment_test {

Trajectory FromCenters(const std::vector<Eigen::Vector3d>& centers) {
  Trajectory trajectory;
  for (size_t i = 0; i < centers.size(); ++i) {
    trajectory.push_back({static_cast<int64_t>(i) * 1000000, Rigid3(Eigen::Quaterniond::Identity(), centers[i])});
  }
  return trajectory;
}

const std::vector<Eigen::Vector3d> kCorners = {{1, 1, 0}, {-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}};

TEST(AlignPointsTest, RecoversAKnownSimilarity) {
  const Similarity3 truth(2.5, Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, -2, 0.5).normalized())),
                          {10, -20, 30});
  const std::vector<Eigen::Vector3d> source = {{0, 0, 0}, {1, 0, 0.2}, {1, 2, 0}, {-3, 1, 4}, {0.5, 0.5, 9}};
  std::vector<Eigen::Vector3d> to;
  for (const Eigen::Vector3d& p : source) to.push_back(truth * p);
  const PointAlignment found = AlignPoints(source, to, AlignmentKind::kSimilarity);
  ASSERT_TRUE(found.success);
  EXPECT_FALSE(found.collinear);
  EXPECT_NEAR(found.to_from_source.scale, 2.5, 1e-12);
  EXPECT_LT(found.to_from_source.rotation.angularDistance(truth.rotation), 1e-7);
  EXPECT_LT((found.to_from_source.translation - truth.translation).norm(), 1e-10);
}

TEST(AlignPointsTest, RigidKeepsTheLengths) {
  std::vector<Eigen::Vector3d> to;
  for (const Eigen::Vector3d& p : kCorners) to.push_back(2 * p);
  const PointAlignment found = AlignPoints(kCorners, to, AlignmentKind::kRigid);
  ASSERT_TRUE(found.success);
  EXPECT_EQ(found.to_from_source.scale, 1.0);
}

TEST(AlignPointsTest, NeverMirrors) {
  // The best orthogonal matrix from these points to their mirror image is a reflection: a rotation must come out all
  // the same.
  const std::vector<Eigen::Vector3d> source = {{3, 0, 0}, {0, 2, 0}, {0, 0, 1}, {0, 0, 0}};
  std::vector<Eigen::Vector3d> to;
  for (const Eigen::Vector3d& p : source) to.emplace_back(p.x(), p.y(), -p.z());
  const PointAlignment found = AlignPoints(source, to, AlignmentKind::kSimilarity);
  ASSERT_TRUE(found.success);
  EXPECT_NEAR(found.to_from_source.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
}

TEST(AlignPointsTest, DegenerateInputsSayWhy) {
  EXPECT_EQ(AlignPoints({{0, 0, 0}, {1, 0, 0}}, {{0, 0, 0}, {1, 0, 0}}, AlignmentKind::kSimilarity).reason,
            "alignment needs at least 3 pairs, there are 2");
  const std::vector<Eigen::Vector3d> same(4, Eigen::Vector3d(5, 6, 7));
  EXPECT_FALSE(AlignPoints(same, kCorners, AlignmentKind::kSimilarity).success);
  EXPECT_TRUE(AlignPoints(same, same, AlignmentKind::kRigid).success);
  const PointAlignment line =
      AlignPoints({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 0, 0}, {0, 3, 0}, {0, 6, 0}}, AlignmentKind::kSimilarity);
  ASSERT_TRUE(line.success);
  EXPECT_TRUE(line.collinear);
  EXPECT_NEAR(line.to_from_source.scale, 3.0, 1e-12);
}

TEST(AssociateByTimeTest, ClosestFirstAndEachPoseOnce) {
  Trajectory estimate(3), reference(3);
  estimate[0].utime = 100;
  estimate[1].utime = 104;  // closer to reference 105 than 100 is
  estimate[2].utime = 500;  // too far from all
  reference[0].utime = 900;
  reference[1].utime = 105;
  reference[2].utime = 93;
  const std::vector<TimePair> pairs = AssociateByTime(estimate, reference, 7);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].estimate, 0u);
  EXPECT_EQ(pairs[0].reference, 2u);
  EXPECT_EQ(pairs[1].estimate, 1u);
  EXPECT_EQ(pairs[1].reference, 1u);
  EXPECT_EQ(AssociateByTime(estimate, reference, 6).size(), 1u);  // the tolerance is inclusive: 93 is 7 away
}

TEST(EvaluateTrajectoryTest, KnownDeviationGivesKnownErrors) {
  // Corners of a square lifted and lowered in turn by 0.3: no similarity of the flat square fits better than the
  // identity.
  const double d = 0.3;
  const Trajectory reference = FromCenters({{1, 1, d}, {-1, 1, -d}, {-1, -1, d}, {1, -1, -d}});
  for (const AlignmentKind kind : {AlignmentKind::kSimilarity, AlignmentKind::kRigid}) {
    EvaluationOptions options;
    options.kind = kind;
    const Evaluation e = EvaluateTrajectory(FromCenters(kCorners), reference, options);
    ASSERT_TRUE(e.success);
    EXPECT_NEAR(e.rmse, d, 1e-12);
    EXPECT_NEAR(e.mean, d, 1e-12);
    EXPECT_NEAR(e.median, d, 1e-12);
    EXPECT_NEAR(e.max, d, 1e-12);
    EXPECT_EQ(e.coverage, 1.0);
  }
}

TEST(EvaluateTrajectoryTest, StatisticsOfALineFitByHand) {
  // Least squares of t = 0, 1, 2, 7 on s = 0, 1, 2, 3: slope 11/5, residuals 0.8, -0.4, -1.6, 1.2.
  const Trajectory estimate = FromCenters({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  Trajectory reference = FromCenters({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {7, 0, 0}});
  reference.push_back({99000000, Rigid3()});  // a frame that was not tracked
  const Evaluation e = EvaluateTrajectory(estimate, reference, EvaluationOptions());
  ASSERT_TRUE(e.success);
  EXPECT_TRUE(e.collinear);
  EXPECT_NEAR(e.reference_from_estimate.scale, 2.2, 1e-12);
  EXPECT_NEAR(e.rmse, std::sqrt(1.2), 1e-12);
  EXPECT_NEAR(e.mean, 1.0, 1e-12);
  EXPECT_NEAR(e.median, 1.0, 1e-12);
  EXPECT_NEAR(e.max, 1.6, 1e-12);
  EXPECT_EQ(e.max_utime, 2000000);
  EXPECT_EQ(e.pairs.size(), 4u);
  EXPECT_NEAR(e.coverage, 0.8, 1e-12);
}

TEST(EvaluateTrajectoryTest, RigidAlignmentSeesAWrongScale) {
  Trajectory reference = FromCenters(kCorners);
  for (StampedPose& pose : reference) pose.world_from_camera.translation *= 2;
  EvaluationOptions options;
  EXPECT_NEAR(EvaluateTrajectory(FromCenters(kCorners), reference, options).rmse, 0.0, 1e-12);
  options.kind = AlignmentKind::kRigid;
  EXPECT_NEAR(EvaluateTrajectory(FromCenters(kCorners), reference, options).rmse, std::sqrt(2.0), 1e-12);
}

TEST(EvaluateTrajectoryTest, GroundTruthAgainstItselfIsZero) {
  const Trajectory truth =
      ReadTrajectory(std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/groundtruth.tum");
  const Similarity3 moved(0.1, Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d::UnitX())), {1, 2, 3});
  const Evaluation e = EvaluateTrajectory(TransformTrajectory(truth, moved), truth, EvaluationOptions());
  ASSERT_TRUE(e.success);
  EXPECT_EQ(e.pairs.size(), 171u);  // one of the 172 photos has no ground truth
  EXPECT_LT(e.max, 1e-9);
  EXPECT_NEAR(e.reference_from_estimate.scale, 10.0, 1e-9);
}

TEST(EvaluateTrajectoryTest, NoCommonTimeIsExplained) {
  Trajectory late = FromCenters(kCorners);
  for (StampedPose& pose : late) pose.utime += 1000000000;
  const Evaluation e = EvaluateTrajectory(late, FromCenters(kCorners), EvaluationOptions());
  EXPECT_FALSE(e.success);
  EXPECT_NE(e.reason.find("clock"), std::string::npos);
}

}  // namespace alignment_test
}  // namespace mapmend

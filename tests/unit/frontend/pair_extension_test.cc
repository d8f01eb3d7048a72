#include "procs/frontend/pair_extension.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "procs/frontend/local_mapper.h"
#include "procs/frontend/sparse_beginning.h"
#include "procs/frontend/submap_starter.h"
#include "tests/unit/frontend/sparse_flight.h"

namespace mapmend {
namespace pair_extension_test {

// A submap of two photos, and one that follows.
class PairExtensions : public testing::Test {
 protected:
  PairExtensions() : flight_(5), extension_({}, flight_.Camera(), {}) {
    SparseBeginning beginning({}, flight_.Camera(), {});
    Initialization found;
    for (int i = 0; i < 3; ++i) {
      poses_.push_back(flight_.Pose(SparseFlight::kStep * i, 0));
      next_ = flight_.Photo(poses_.back(), i);
      found = beginning.AddFrame(next_);
    }
    EXPECT_TRUE(found.success);
    LocalMapper mapper({}, flight_.Camera(), {});
    map_ = MapOfBeginning(found, SubmapId(0), {}, &mapper, &ids_);
    scale_ = map_->Keyframe(kSecond).cam_from_submap.Center().norm() / (poses_[1].Center() - poses_[0].Center()).norm();
  }
  // Where the submap should have it.
  Eigen::Vector3d InSubmap(const Eigen::Vector3d& x) const { return scale_ * (poses_[0] * x); }

  static constexpr KeyframeIndex kFirst{0}, kSecond{1};
  SparseFlight flight_;
  PairExtension extension_;
  std::vector<Rigid3> poses_;
  FramePtr next_;
  IdSource ids_;
  std::unique_ptr<WorkingMap> map_;
  double scale_ = 1;
};

TEST_F(PairExtensions, APhotoThatSharesFewPointsWithTheMapGetsItsPoseAndBringsNewPoints) {
  const TrackResult result = extension_.Track({kSecond, kFirst}, next_, *map_);
  ASSERT_TRUE(result.success);
  EXPECT_EQ(result.method, TrackMethod::kPair);
  EXPECT_EQ(result.reference_keyframe, kSecond);
  const Rigid3 expected = poses_[2] * poses_[0].Inverse();
  EXPECT_LT(RotationAngle(result.cam_from_submap.rotation * expected.rotation.conjugate()), 0.01);
  EXPECT_LT((result.cam_from_submap.Center() - InSubmap(poses_[2].Center())).norm(), 0.02 * scale_);
  const std::vector<Eigen::Vector3d> truth = flight_.Shown(2);
  int num_known = 0;
  for (size_t i = 0; i < result.points.size(); ++i) {
    if (result.points[i].IsNone()) continue;
    ++num_known;
    EXPECT_LT((map_->Point(result.points[i]).position - InSubmap(truth[i])).norm(), 0.06 * scale_) << i;
  }
  EXPECT_GE(num_known, 8);
  EXPECT_GT(result.new_points.size(), static_cast<size_t>(num_known)) << "most of what the two share is new";
  for (const InitialPoint& p : result.new_points)
    EXPECT_LT((p.position - InSubmap(truth[p.second_feature])).norm(), 0.06 * scale_);
}

// What the map knows contradicts itself: there is no scale.
TEST_F(PairExtensions, PointsAtDepthsThatDoNotGoTogetherGiveNoPose) {
  Random random(1);
  for (const PointIndex p : map_->PointsOf(kSecond))
    map_->SetPosition(p, (0.5 + random.Uniform()) * map_->Point(p).position);
  const TrackResult result = extension_.Track({kSecond, kFirst}, next_, *map_);
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.reason, LossReason::kTooFewMatches);
}

TEST_F(PairExtensions, APhotoOfAnotherPlaceHasNoPose) {
  const FramePtr elsewhere = flight_.Photo(flight_.Pose(5, 5), 3);
  EXPECT_FALSE(extension_.Track({kSecond, kFirst}, elsewhere, *map_).success);
}

TEST(MotionVotes, AreClearIfEnoughAgreeWithOneAndClearlyFewerWithAnyOther) {
  const TwoViewCandidate right, wrong;
  const auto vote = [&](std::initializer_list<std::pair<const TwoViewCandidate*, DepthAgreement>> agreements) {
    MotionVote result{PhotoPairOptions()};
    for (const auto& [motion, agreement] : agreements) result.Add(*motion, agreement);
    return result;
  };
  EXPECT_FALSE(vote({}).HasWinner());
  EXPECT_FALSE(vote({{&right, {2, 7, 7}}}).HasWinner()) << "too few";
  EXPECT_FALSE(vote({{&right, {2, 30, 12}}}).HasWinner()) << "most do not agree";
  EXPECT_TRUE(vote({{&right, {2, 8, 8}}}).IsClear());
  for (const MotionVote& v :
       {vote({{&wrong, {3, 4, 4}}, {&right, {2, 8, 8}}}), vote({{&right, {2, 8, 8}}, {&wrong, {3, 4, 4}}})}) {
    EXPECT_TRUE(v.IsClear());
    EXPECT_EQ(&v.Winner(), &right);
    EXPECT_EQ(v.Scale(), 2);
  }
  for (const MotionVote& v :
       {vote({{&wrong, {3, 5, 5}}, {&right, {2, 8, 8}}}), vote({{&right, {2, 8, 8}}, {&wrong, {3, 5, 5}}})}) {
    EXPECT_TRUE(v.HasWinner());
    EXPECT_FALSE(v.IsClear());
  }
}

TEST(DepthComparison, CountsWhatAgreesUpToAScale) {
  const DepthAgreement agreement = Compare({0, 2, 4, 6, 8, 3}, {1, 1, 2, 3, 0, 3}, 0.05);
  EXPECT_EQ(agreement.num_common, 4) << "where both are known";
  EXPECT_EQ(agreement.num_agreeing, 3);
  EXPECT_EQ(agreement.scale, 2);
}

}  // namespace pair_extension_test
}  // namespace mapmend

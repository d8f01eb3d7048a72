#include "procs/frontend/beginning_trial.h"

#include <gtest/gtest.h>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace beginning_trial_test {

using Verdict = BeginningTrial::Verdict;

// A submap of two views that are `step` apart, `frames` frames after each other; its points lie where they are times
// `scale_of_depth`.
class BeginningTrialTest : public ::testing::Test {
 protected:
  void Begin(double step, int frames, const BeginningTrialOptions& options = {}) {
    map_ = std::make_unique<WorkingMap>(SubmapId(0), Pyramid(), &ids_);
    trial_ = std::make_unique<BeginningTrial>(options, scene_.Camera());
    const Initialization initialization = Of(0, frames, step);
    map_->AddKeyframe(initialization.first, Rigid3());
    map_->AddKeyframe(initialization.second, initialization.second_from_first);
    points_.assign(initialization.first->features.Size(), PointIndex());
    for (const InitialPoint& p : initialization.points) {
      points_[p.first_feature] = map_->AddPoint(p.position, KeyframeIndex(0));
      map_->AddObservation(points_[p.first_feature], KeyframeIndex(0), p.first_feature);
      map_->AddObservation(points_[p.first_feature], KeyframeIndex(1), p.second_feature);
    }
    trial_->Begin(initialization, *map_);
  }
  // What a beginning with frame 0 and one that is x away tells; features of both are those of the same points.
  Initialization Of(int first, int second, double x) {
    Initialization result;
    const Rigid3 pose = NadirPose(0, 0);
    result.first = scene_.View(pose, first, 0, 0);
    const std::vector<Eigen::Vector3d> shown = scene_.Shown(first);
    result.second = scene_.View(NadirPose(x, 0), second, 0, 0);
    const std::vector<Eigen::Vector3d> shown_second = scene_.Shown(second);
    result.second_from_first = NadirPose(x, 0) * pose.Inverse();
    result.success = true;
    for (size_t i = 0; i < shown.size(); ++i) {
      const auto other = std::find(shown_second.begin(), shown_second.end(), shown[i]);
      if (other == shown_second.end()) continue;
      result.points.push_back({FeatureIndex(static_cast<int>(i)),
                               FeatureIndex(static_cast<int>(other - shown_second.begin())), pose * shown[i]});
    }
    return result;
  }
  Verdict Next(double x) { return trial_->Next(NadirPose(x, 0) * NadirPose(0, 0).Inverse(), points_, *map_); }

  SyntheticScene scene_{1500, -1, 1, 0.2, 5};
  IdSource ids_;
  std::unique_ptr<WorkingMap> map_;
  std::unique_ptr<BeginningTrial> trial_;
  std::vector<PointIndex> points_;
};

TEST_F(BeginningTrialTest, PhotosStandAtOnce) {
  Begin(0.1, 1);
  EXPECT_EQ(Next(0.2), Verdict::kStands);
}

TEST_F(BeginningTrialTest, ASlowVideoIsAskedWhenItsParallaxHasDoubled) {
  Begin(0.04, 10);
  for (const double x : {0.044, 0.06, 0.075}) EXPECT_EQ(Next(x), Verdict::kUndecided) << x;
  EXPECT_EQ(Next(0.085), Verdict::kAsk);
  trial_->Postpone();
  EXPECT_EQ(Next(0.09), Verdict::kUndecided);
  EXPECT_EQ(Next(0.1), Verdict::kAsk);
}

TEST_F(BeginningTrialTest, StandsWhenItCannotBeAskedAnyMore) {
  BeginningTrialOptions options;
  options.patience = 3;
  Begin(0.04, 10, options);
  EXPECT_EQ(Next(0.044), Verdict::kUndecided);
  EXPECT_EQ(Next(0.048), Verdict::kUndecided);
  EXPECT_EQ(Next(0.052), Verdict::kStands);
  Begin(0.04, 10);
  std::fill(points_.begin() + 20, points_.end(), PointIndex());  // the first view is out of sight
  EXPECT_EQ(Next(0.044), Verdict::kStands);
}

TEST_F(BeginningTrialTest, IsContradictedByAnotherPlaceOfTheCameraOrOtherDepths) {
  Begin(0.04, 10);
  const Initialization wider = Of(0, 30, 0.1);
  const Rigid3 right = wider.second_from_first;
  EXPECT_FALSE(trial_->Contradicts(wider, right, *map_));
  Rigid3 wrong = right;
  wrong.translation += Eigen::Vector3d(0, 0.05, 0);
  EXPECT_TRUE(trial_->Contradicts(wider, wrong, *map_));
  // The same in another scale is the same.
  Initialization larger = wider;
  larger.second_from_first.translation *= 3;
  for (InitialPoint& p : larger.points) p.position *= 3;
  EXPECT_FALSE(trial_->Contradicts(larger, right, *map_));
  Initialization other_depths = wider;
  for (InitialPoint& p : other_depths.points) p.position *= 1 + 0.8 * p.position.x();
  EXPECT_TRUE(trial_->Contradicts(other_depths, right, *map_));
}

}  // namespace beginning_trial_test
}  // namespace mapmend

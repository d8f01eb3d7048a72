#include "procs/frontend/beginning_proof.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace {

class BeginningProofTest : public ::testing::Test {
 protected:
  BeginningProofTest() { first_ = scene_.View(NadirPose(0, 0), 0, 0.3); }

  // A beginning of the first frame and one that lies so far beside it, as it is, with this uncertainty; turned: the
  // camera's path, and with it the depths, are wrong, as far as two images allow it.
  Initialization Beginning(double baseline, double sigma, double turned = 0) {
    const int index = ++last_index_;
    const Rigid3 pose = NadirPose(baseline, 0);
    Initialization beginning;
    beginning.first = first_;
    beginning.second = scene_.View(pose, index, 0.3);
    beginning.second_from_first = pose * NadirPose(0, 0).Inverse();
    const Eigen::AngleAxisd turn(turned, Eigen::Vector3d::UnitY());
    beginning.second_from_first.translation = turn * beginning.second_from_first.translation;
    beginning.shape_sigma = sigma;
    beginning.median_angle_deg = std::atan(baseline) * 180 / M_PI;  // the camera flies one unit above the ground
    const std::vector<Eigen::Vector3d> in_first = scene_.Shown(0), in_second = scene_.Shown(index);
    for (size_t i = 0; i < in_first.size(); ++i) {
      for (size_t j = 0; j < in_second.size(); ++j) {
        if (in_first[i] == in_second[j])
          beginning.points.push_back({static_cast<int>(i), static_cast<int>(j), NadirPose(0, 0) * in_first[i]});
      }
    }
    return beginning;
  }

  SyntheticScene scene_{400, -1, 1, 0.2, 1};
  FramePtr first_;
  int last_index_ = 0;
  BeginningProof proof_{{}, scene_.Camera(), {}};
};

TEST_F(BeginningProofTest, WhatIsCertainIsBelievedAtOnce) {
  Initialization beginning = Beginning(0.1, 0.02);
  EXPECT_TRUE(proof_.Weigh(&beginning));
  EXPECT_FALSE(beginning.is_uncertain);
}

TEST_F(BeginningProofTest, NothingIsCertainUnderASmallAngle) {
  Initialization narrow = Beginning(0.03, 0.02), wide = Beginning(0.06, 0.02);
  EXPECT_FALSE(proof_.Weigh(&narrow));
  EXPECT_TRUE(proof_.Weigh(&wide));
}

TEST_F(BeginningProofTest, WhatForetellsAWiderOneProvesIt) {
  Initialization narrow = Beginning(0.05, 0.1), wider = Beginning(0.06, 0.1), wide = Beginning(0.1, 0.1);
  EXPECT_FALSE(proof_.Weigh(&narrow));
  EXPECT_FALSE(proof_.Weigh(&wider));  // the parallax has hardly grown
  EXPECT_TRUE(proof_.Weigh(&wide));
  EXPECT_FALSE(wide.is_uncertain);
}

TEST_F(BeginningProofTest, WhatForetellsSomethingElseProvesNothing) {
  Initialization narrow = Beginning(0.05, 0.1, 0.5), wide = Beginning(0.1, 0.1);
  EXPECT_FALSE(proof_.Weigh(&narrow));
  EXPECT_FALSE(proof_.Weigh(&wide));
  EXPECT_GT(proof_.Disagreement(narrow, wide), 0.3);
  EXPECT_LT(proof_.Disagreement(Beginning(0.05, 0.1), wide), 0.05);
}

TEST_F(BeginningProofTest, PatienceEnds) {
  const BeginningProofOptions options;
  Initialization beginning = Beginning(0.05, 0.1);
  EXPECT_FALSE(proof_.Weigh(&beginning));
  for (int i = 0; i + 1 < options.start_patience; ++i) proof_.CountFrame();
  EXPECT_FALSE(proof_.Weigh(&beginning));
  proof_.CountFrame();
  Initialization hopeless = Beginning(0.05, 0.5);
  EXPECT_FALSE(proof_.Weigh(&hopeless));
  EXPECT_TRUE(proof_.Weigh(&beginning));
  EXPECT_TRUE(beginning.is_uncertain);
  proof_.Clear();
  EXPECT_FALSE(proof_.Weigh(&beginning));
}

}  // namespace
}  // namespace mapmend

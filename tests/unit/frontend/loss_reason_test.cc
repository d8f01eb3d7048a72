#include "procs/frontend/loss_reason.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "procs/frontend/frontend.h"
#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace loss_reason_test {

// A flight over one place, of which each test spoils the last image.
struct Flight {
  explicit Flight(const FrontendOptions& options = {}) : frontend(options, scene.Camera(), {}, nullptr, Ignore) {}
  static void Ignore(int64_t, RecordBody) {}
  FrameOutcome Fly(const Rigid3& pose) { return frontend.ProcessFrame(scene.View(pose, next++)); }
  void FlyAhead() {
    for (int i = 0; i < 12; ++i) Fly(NadirPose(0.12 * i, 0));
  }
  // An image of nothing that was seen before.
  std::shared_ptr<Frame> Elsewhere() { return elsewhere.View(NadirPose(0, 0), next++); }

  SyntheticScene scene{12000, -1.5, 6, 0.1, 1}, elsewhere{12000, -1.5, 6, 0.1, 2};
  Frontend frontend;
  int next = 0;
};

TEST(LossReason, AnImageThatStartsNoMap) {
  Flight dark, blurred, empty, fine;
  auto frame = dark.Elsewhere();
  frame->mean_brightness = 5;
  EXPECT_EQ(dark.frontend.ProcessFrame(frame).cause, LossReason::kDarkness);
  frame = blurred.Elsewhere();
  frame->sharpness = 2;
  EXPECT_EQ(blurred.frontend.ProcessFrame(frame).cause, LossReason::kBlur);
  SyntheticScene nothing(10, -1.5, 6, 0.1, 4);
  EXPECT_EQ(empty.frontend.ProcessFrame(nothing.View(NadirPose(0, 0), 0)).cause, LossReason::kTooFewFeatures);
  EXPECT_EQ(fine.frontend.ProcessFrame(fine.Elsewhere()).cause, LossReason::kTooFewMatches);
  Frontend narrow({}, Pinhole{100, 100, 80, 60, 160, 120}, {}, nullptr, Flight::Ignore);
  EXPECT_EQ(narrow.ProcessFrame(fine.Elsewhere()).cause, LossReason::kSmallImages);
}

TEST(LossReason, TwoImagesThatStartNoMap) {
  FrontendOptions careful;
  careful.starter.initializer.min_median_angle_deg = 5;
  Flight still, creeping(careful), shuffled;
  still.Fly(NadirPose(0, 0));
  EXPECT_EQ(still.Fly(NadirPose(0, 0)).cause, LossReason::kNoMotion);
  creeping.Fly(NadirPose(0, 0));
  EXPECT_EQ(creeping.Fly(NadirPose(0.06, 0)).cause, LossReason::kNoParallax);
  shuffled.Fly(NadirPose(0, 0));
  const auto frame = shuffled.scene.View(NadirPose(0, 0), 1);
  Random random(1);
  for (Keypoint& k : frame->features.keypoints) {
    k.pixel = Eigen::Vector2d(800 * random.Uniform(), 600 * random.Uniform()).cast<float>();
  }
  frame->grid = FeatureGrid(frame->features.keypoints, 800, 600);
  EXPECT_EQ(shuffled.frontend.ProcessFrame(frame).cause, LossReason::kNoCommonMotion);
  FrontendOptions options;
  options.starter.initializer.ambiguity_ratio = 0;
  options.starter.initializer.max_misfit_ratio = 0;
  Flight ambiguous(options);
  ambiguous.Fly(NadirPose(0, 0));
  EXPECT_EQ(ambiguous.Fly(NadirPose(0.2, 0)).cause, LossReason::kAmbiguous);
}

TEST(LossReason, AnImageThatIsNotTracked) {
  Flight dark, blurred, late, other;
  for (Flight* f : {&dark, &blurred, &late, &other}) f->FlyAhead();
  auto frame = dark.Elsewhere();
  frame->mean_brightness = 5;
  EXPECT_EQ(dark.frontend.ProcessFrame(frame).reason, LossReason::kDarkness);
  frame = blurred.Elsewhere();
  frame->sharpness = 3;
  EXPECT_EQ(blurred.frontend.ProcessFrame(frame).reason, LossReason::kBlur);
  frame = late.Elsewhere();
  frame->utime += 10000000;
  EXPECT_EQ(late.frontend.ProcessFrame(frame).reason, LossReason::kInputGap);
  EXPECT_EQ(other.frontend.ProcessFrame(other.Elsewhere()).reason, LossReason::kTooFewMatches);
}

// Two frames fit, but bundle adjustment finds too few of their points good.
TEST(LossReason, ABeginningOfWhichNoMapComes) {
  FrontendOptions strict;
  strict.mapper.outlier_chi2 = 1e-3;
  Flight flight(strict), usual;
  for (Flight* f : {&flight, &usual}) f->Fly(NadirPose(0, 0));
  EXPECT_EQ(usual.Fly(NadirPose(0.2, 0)).cause, LossReason::kNone);
  EXPECT_EQ(flight.Fly(NadirPose(0.2, 0)).cause, LossReason::kNotConfirmed);
  EXPECT_EQ(flight.frontend.NumSubmaps(), 0);
}

TEST(LossReason, TooFewInliersAbandonWhatWasBegun) {
  FrontendOptions options;
  options.tracker.min_inliers = 100000;
  Flight flight(options);
  LossReason abandoned = LossReason::kNone;
  for (int i = 0; i < 4 && abandoned == LossReason::kNone; ++i)
    abandoned = flight.Fly(NadirPose(0.12 * i, 0)).abandoned;
  EXPECT_EQ(abandoned, LossReason::kTooFewInliers);
}

TEST(LossReason, AJumpIsBelievedOnlyIfEnoughIsFound) {
  for (const double share : {0.0, 2.0}) {
    FrontendOptions options;
    options.jump_found_share = share;
    Flight flight(options);
    flight.FlyAhead();
    for (int i = 1; i < 4; ++i) flight.Fly(NadirPose(1.32 + 0.01 * i, 0));
    const FrameOutcome outcome = flight.Fly(NadirPose(1.75, 0));
    EXPECT_EQ(outcome.reason, share == 0 ? LossReason::kNone : LossReason::kInconsistentMotion) << share;
  }
}

// A frame that was lost is tracked afterwards, from the one that was found again.
TEST(Frontend, LostFramesTrackedAfterwardsAreHeldToStricterBounds) {
  const auto num_found = [](double max_sigma) {
    FrontendOptions options;
    options.jump_found_share = 2;
    options.tracker.max_position_sigma_afterwards = max_sigma;
    Flight flight(options);
    flight.FlyAhead();
    for (int i = 1; i < 4; ++i) flight.Fly(NadirPose(1.32 + 0.01 * i, 0));
    const int before = flight.frontend.NumTracked();
    EXPECT_EQ(flight.Fly(NadirPose(1.75, 0)).reason, LossReason::kInconsistentMotion);
    EXPECT_EQ(flight.Fly(NadirPose(1.36, 0)).reason, LossReason::kNone);
    return flight.frontend.NumTracked() - before;
  };
  EXPECT_EQ(num_found(0.008), 2);
  EXPECT_EQ(num_found(0), 1);
}

// Frames between the first two keyframes are tracked afterwards.
TEST(Frontend, FramesTrackedAfterwardsAreHeldToStricterBounds) {
  const auto num_tracked = [](double min_spread, double max_sigma) {
    FrontendOptions options;
    options.tracker.min_spread_afterwards = min_spread;
    options.tracker.max_position_sigma_afterwards = max_sigma;
    Flight flight(options);
    for (int i = 0; i < 20; ++i) flight.Fly(NadirPose(0.01 * i, 0));
    return flight.frontend.NumTracked();
  };
  EXPECT_EQ(num_tracked(0.2, 0.008), 20);
  EXPECT_LT(num_tracked(1.1, 0.008), 20);
  EXPECT_LT(num_tracked(0.2, 0), 20);
}

TEST(LossReason, TextsAreWhatRecordsAndEventsSay) {
  const char* const texts[] = {"",
                               "darkness",
                               "blur",
                               "small_images",
                               "input_gap",
                               "too_few_features",
                               "too_few_matches",
                               "no_common_motion",
                               "no_motion",
                               "no_parallax",
                               "ambiguous",
                               "not_confirmed",
                               "too_few_inliers",
                               "unsupported_pose",
                               "inconsistent_motion",
                               "end_of_input"};
  for (size_t i = 0; i < std::size(texts); ++i) EXPECT_EQ(ToString(static_cast<LossReason>(i)), texts[i]);
  EXPECT_EQ(ToString(TrackMethod::kDescriptors), "descriptors");
  EXPECT_EQ(ToString(TrackMethod::kPair), "pair");
}

}  // namespace loss_reason_test
}  // namespace mapmend

// Photos that show nothing to ORB: what the frontend makes of them.

#include "procs/frontend/sparse_photos.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/core.hpp>
#include <set>

#include "libs/stream/submap.h"
#include "procs/frontend/frontend.h"
#include "tests/unit/frontend/sparse_flight.h"

namespace mapmend {
namespace sparse_photos_test {

class SparseRun {
 public:
  explicit SparseRun(uint64_t seed, double interval_s = 5)
      : interval_s_(interval_s),
        flight_(seed),
        frontend_({}, flight_.Camera(), {}, nullptr, [this](int64_t utime, RecordBody body) {
          EXPECT_EQ(session_.Apply({{"test", next_seq_++, utime}, std::move(body)}), "");
        }) {
    EXPECT_EQ(session_.Apply({{"test", next_seq_++, 0}, SessionStarted{}}), "");
    frontend_.ConvertSparsePhotos([this](const FramePtr& photo) {
      ++num_converted_;
      return converted_.at(photo->index);
    });
  }

  FrameOutcome See(double x, double y) {
    const int index = static_cast<int>(converted_.size());
    poses_.push_back(flight_.Pose(x, y));
    const auto photo = std::make_shared<Frame>();
    photo->index = index;
    photo->utime = static_cast<int64_t>(1e6 * interval_s_ * index);
    photo->mean_brightness = 120;
    photo->sharpness = 10;
    photo->grid = FeatureGrid({}, flight_.Camera().width, flight_.Camera().height);
    photo->image = std::make_shared<const cv::Mat>();
    const auto converted = std::make_shared<Frame>(*flight_.Photo(poses_.back(), index));
    converted->utime = photo->utime;
    converted->photo = photo;
    converted_[index] = converted;
    return frontend_.ProcessFrame(photo);
  }
  const Session& Finish() {
    frontend_.Finish();
    return session_;
  }

  std::set<int> Tracked() const {
    std::set<int> tracked;
    for (const auto& [id, submap] : session_.submaps) {
      for (const TrackedFrame& f : submap.frames) tracked.insert(f.frame);
    }
    return tracked;
  }
  const Rigid3& Truth(int index) const { return poses_[index]; }
  int NumConverted() const { return num_converted_; }

 private:
  double interval_s_;
  SparseFlight flight_;
  int64_t next_seq_ = 0;
  int num_converted_ = 0;
  std::map<int, FramePtr> converted_;
  std::vector<Rigid3> poses_;
  Session session_;
  Frontend frontend_;
};

TEST(SparsePhotos, AStripBecomesOneSubmap) {
  SparseRun run(1);
  for (int i = 0; i < 8; ++i) {
    const FrameOutcome outcome = run.See(SparseFlight::kStep * i, 0);
    EXPECT_EQ(outcome.state == FrontendState::kTracking, i >= 2) << i;
    EXPECT_EQ(outcome.submap_begin, i == 2 ? 0 : -1) << "believed with the third photo";
  }
  const Session& session = run.Finish();
  ASSERT_EQ(session.submaps.size(), 1u);
  const Submap& submap = session.submaps.begin()->second;
  ASSERT_EQ(submap.frames.size(), 8u);
  std::map<int, Eigen::Vector3d> centers;
  for (const TrackedFrame& f : submap.frames) centers[f.frame] = submap.CamFromSubmap(f).Center();
  const double scale = (run.Truth(7).Center() - run.Truth(0).Center()).norm() / (centers[7] - centers[0]).norm();
  for (int i = 1; i < 8; ++i) {
    const double expected = (run.Truth(i).Center() - run.Truth(0).Center()).norm();
    EXPECT_NEAR(scale * (centers[i] - centers[0]).norm(), expected, 0.03 * expected) << i;
  }
  // Where no third photo can confirm them, points of two stay.
  const auto of_two = [](const auto& entry) {
    const auto& observations = entry.second.observations;
    return observations.size() == 2 && observations.back().keyframe <= KeyframeId(1);
  };
  EXPECT_GT(std::count_if(submap.points.begin(), submap.points.end(), of_two), 100) << "of the first two";
}

TEST(SparsePhotos, AVideoIsLeftAlone) {
  SparseRun run(1, 0.1);
  for (int i = 0; i < 8; ++i) EXPECT_NE(run.See(SparseFlight::kStep * i, 0).state, FrontendState::kTracking) << i;
  EXPECT_TRUE(run.Finish().submaps.empty());
  EXPECT_EQ(run.NumConverted(), 0);
}

// A photo beside the flight has nothing in common with its neighbours in time. The next strip sees its ground.
TEST(SparsePhotos, OneThatWasLeftOverIsFoundFromTheNextStrip) {
  SparseRun run(2);
  for (int i = 0; i < 4; ++i) run.See(SparseFlight::kStep * i, 0);
  const int left_over = 4;
  EXPECT_EQ(run.See(3 * SparseFlight::kStep, 2.3).state, FrontendState::kLost);
  for (int i = 3; i >= 0; --i) run.See(SparseFlight::kStep * i, 0.8);
  EXPECT_FALSE(run.Tracked().contains(left_over));
  for (int i = 0; i < 4; ++i) run.See(SparseFlight::kStep * i, 1.7);
  const Session& session = run.Finish();
  EXPECT_TRUE(run.Tracked().contains(left_over));
  EXPECT_EQ(run.Tracked().size(), 13u);
  EXPECT_LE(session.submaps.size(), 2u);
}

// The camera cannot have been there and back again between two photos.
TEST(SparsePhotos, OneThatWasTooFarAwayStaysLeftOver) {
  SparseRun run(2);
  for (int i = 0; i < 4; ++i) run.See(SparseFlight::kStep * i, 0);
  const int left_over = 4;
  run.See(3 * SparseFlight::kStep, 3);
  for (const double y : {0.8, 1.6, 2.4}) {
    for (int i = 3; i >= 0; --i) run.See(SparseFlight::kStep * i, y);
  }
  run.Finish();
  EXPECT_FALSE(run.Tracked().contains(left_over));
  EXPECT_EQ(run.Tracked().size(), 16u);
}

// It shows ground that looks like that of the beginning.
TEST(SparsePhotos, APhotoOfAPlaceThatIsTooFarAwayIsNotTracked) {
  SparseRun run(3);
  for (int i = 0; i < 8; ++i) run.See(SparseFlight::kStep * i, 0);
  const FrameOutcome outcome = run.See(0.1, 0);
  EXPECT_EQ(outcome.state, FrontendState::kLost);
  EXPECT_EQ(outcome.reason, LossReason::kInconsistentMotion);
  run.Finish();
  EXPECT_EQ(run.Tracked().size(), 8u);
}

}  // namespace sparse_photos_test
}  // namespace mapmend

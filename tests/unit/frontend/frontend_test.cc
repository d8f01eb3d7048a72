#include "procs/frontend/frontend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "libs/retrieval/vocabulary.h"
#include "libs/stream/submap.h"
#include "tests/unit/frontend/synthetic_flight.h"

namespace mapmend {
namespace frontend_test {

// Runs the frontend and applies its records to the read model that everything downstream uses.
struct Replay {
  explicit Replay(const SyntheticScene& scene, bool mapping_thread = false) : Replay(scene, Options(mapping_thread)) {}
  Replay(const SyntheticScene& scene, const FrontendOptions& options, const Vocabulary* vocabulary = nullptr)
      : frontend(options, scene.Camera(), {}, vocabulary, [this](int64_t utime, RecordBody body) {
          const std::string error = session.Apply({{"test", next_seq++, utime}, std::move(body)});
          EXPECT_EQ(error, "");
        }) {
    EXPECT_EQ(session.Apply({{"test", next_seq++, 0}, SessionStarted{}}), "");
  }
  static FrontendOptions Options(bool mapping_thread) {
    FrontendOptions options;
    options.mapping_thread = mapping_thread;
    return options;
  }
  int64_t next_seq = 0;
  Session session;
  Frontend frontend;
};

// Whether keyframes join the map before the next frame, or meanwhile.
class FrontendThreads : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(MappingThread, FrontendThreads, ::testing::Bool());

TEST_P(FrontendThreads, StraightFlightBecomesOneAccurateSubmap) {
  SyntheticScene scene(12000, -1.5, 6, 0.1, 1);
  Replay run(scene, GetParam());
  std::vector<Rigid3> truth;
  for (int i = 0; i < 30; ++i) {
    truth.push_back(NadirPose(0.12 * i, 0.02 * (i % 3), 0.03 * (i % 2)));
    run.frontend.ProcessFrame(scene.View(truth.back(), i));
  }
  EXPECT_EQ(run.frontend.Finish(), -1) << "it was believed long ago";
  ASSERT_EQ(run.session.submaps.size(), 1u);
  const Submap& submap = run.session.submaps.begin()->second;
  EXPECT_TRUE(submap.ended);
  EXPECT_EQ(submap.end_reason, "end_of_input");
  ASSERT_EQ(submap.frames.size(), 30u);
  // Distances between all frames, scaled by the first leg, against the truth.
  std::vector<Eigen::Vector3d> centers(30);
  for (const TrackedFrame& f : submap.frames) centers[f.frame] = submap.CamFromSubmap(f).Center();
  const double scale = (truth[29].Center() - truth[0].Center()).norm() / (centers[29] - centers[0]).norm();
  for (int i = 1; i < 30; ++i) {
    const double expected = (truth[i].Center() - truth[0].Center()).norm();
    EXPECT_NEAR(scale * (centers[i] - centers[0]).norm(), expected, 0.01 + 0.01 * expected) << i;
  }
}

TEST_P(FrontendThreads, ABeginningThatIsStillOnTrialWhenTheInputEndsIsBelievedThen) {
  SyntheticScene scene(12000, -1.5, 6, 0.1, 1);
  Replay run(scene, GetParam());
  constexpr int kNumFrames = 8;
  for (int i = 0; i < kNumFrames; ++i)
    EXPECT_EQ(run.frontend.ProcessFrame(scene.View(NadirPose(0.01 * i, 0), i)).submap_begin, -1) << i;
  EXPECT_TRUE(run.session.submaps.empty());
  EXPECT_EQ(run.frontend.Finish(), 0);
  ASSERT_EQ(run.session.submaps.size(), 1u);
  EXPECT_EQ(run.session.submaps.begin()->second.frames.size(), static_cast<size_t>(kNumFrames));
}

TEST_P(FrontendThreads, LossClosesTheSubmapAndTheNextBeginsWithTheFirstLostFrame) {
  SyntheticScene scene(30000, -2, 14, 0.1, 2);
  Replay run(scene, GetParam());
  int index = 0;
  for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), index++));
  for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(8 + 0.12 * i, 8), index++));
  run.frontend.Finish();
  ASSERT_EQ(run.session.submaps.size(), 2u);
  EXPECT_EQ(run.frontend.NumLosses(), 1);
  EXPECT_EQ(run.session.submaps.begin()->second.frames.size(), 12u);
  EXPECT_EQ(run.session.submaps.begin()->second.last_frame, 11);
  EXPECT_EQ(run.session.submaps.rbegin()->second.frames.size(), 12u);
}

// What the paper compares with: nothing is mapped until the camera is back where it has been, and then the one submap
// goes on. It comes back to its beginning, far from the keyframes that it was lost after.
TEST_P(FrontendThreads, RelocaliseOnlyWaitsUntilTheMapIsSeenAgain) {
  const Vocabulary vocabulary = Vocabulary::Read(MAPMEND_SOURCE_DIR "/data/vocabulary/mapmend.voc");
  SyntheticScene scene(30000, -2, 14, 0.1, 2);
  FrontendOptions options = Replay::Options(GetParam());
  options.relocalise_only = true;
  Replay run(scene, options, &vocabulary);
  int index = 0;
  for (int i = 0; i < 24; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), index++));
  for (int i = 0; i < 30; ++i) {
    const FrameOutcome outcome = run.frontend.ProcessFrame(scene.View(NadirPose(8 + 0.12 * i, 8), index++));
    EXPECT_EQ(outcome.state, FrontendState::kLost);
  }
  for (int i = 0; i < 6; ++i) {
    const FrameOutcome outcome = run.frontend.ProcessFrame(scene.View(NadirPose(0.06 + 0.12 * i, 0.05), index++));
    EXPECT_EQ(outcome.state, FrontendState::kTracking) << i;
  }
  run.frontend.Finish();
  ASSERT_EQ(run.session.submaps.size(), 1u);
  EXPECT_EQ(run.session.submaps.begin()->second.frames.size(), 30u);
  EXPECT_EQ(run.frontend.NumLosses(), 1);
}

// What looks like the map elsewhere shows some of its points too.
TEST_P(FrontendThreads, RelocaliseOnlyBelievesNoFrameThatSeesTooFewPoints) {
  const Vocabulary vocabulary = Vocabulary::Read(MAPMEND_SOURCE_DIR "/data/vocabulary/mapmend.voc");
  const auto state_when_back = [&](int min_inliers) {
    SyntheticScene scene(30000, -2, 14, 0.1, 2);
    FrontendOptions options = Replay::Options(GetParam());
    options.relocalise_only = true;
    options.relocaliser.min_inliers = min_inliers;
    Replay run(scene, options, &vocabulary);
    int index = 0;
    for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), index++));
    for (int i = 0; i < 6; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(8 + 0.12 * i, 8), index++));
    return run.frontend.ProcessFrame(scene.View(NadirPose(0.06, 0.05), index++)).state;
  };
  EXPECT_EQ(state_when_back(50), FrontendState::kTracking);
  EXPECT_EQ(state_when_back(100000), FrontendState::kLost);
}

TEST_P(FrontendThreads, ShortBlackoutContinuesTheSameSubmap) {
  SyntheticScene scene(12000, -1.5, 6, 0.1, 3);
  SyntheticScene nothing(10, -1.5, 6, 0.1, 4);
  Replay run(scene, GetParam());
  for (int i = 0; i < 25; ++i) {
    const bool blind = i >= 12 && i < 15;
    run.frontend.ProcessFrame((blind ? nothing : scene).View(NadirPose(0.06 * i, 0), i));
  }
  run.frontend.Finish();
  EXPECT_EQ(run.session.submaps.size(), 1u);
  EXPECT_EQ(run.session.submaps.begin()->second.frames.size(), 22u);
}

// To and fro over the same ground: keyframes that say nothing new go, and their frames keep their places.
TEST_P(FrontendThreads, HoveringDoesNotGrowTheMap) {
  SyntheticScene scene(12000, -1.5, 6, 0.1, 1);
  Replay run(scene, GetParam());
  std::vector<Rigid3> truth;
  size_t keyframes_half_way = 0;
  for (int i = 0; i < 160; ++i) {
    truth.push_back(NadirPose(0.1 * std::abs(i % 20 - 10), 0.02 * (i % 3), 0.03 * (i % 2)));
    run.frontend.ProcessFrame(scene.View(truth.back(), i));
    if (i == 80) keyframes_half_way = run.session.submaps.begin()->second.keyframes.size();
  }
  run.frontend.Finish();
  ASSERT_EQ(run.session.submaps.size(), 1u);
  const Submap& submap = run.session.submaps.begin()->second;
  EXPECT_FALSE(submap.removed_keyframes.empty());
  EXPECT_LE(submap.keyframes.size(), keyframes_half_way + 3);
  ASSERT_EQ(submap.frames.size(), truth.size());
  std::vector<Eigen::Vector3d> centers(truth.size());
  for (const TrackedFrame& f : submap.frames) centers[f.frame] = submap.CamFromSubmap(f).Center();
  const double scale = (truth[10].Center() - truth[0].Center()).norm() / (centers[10] - centers[0]).norm();
  for (size_t i = 0; i < truth.size(); ++i) {
    const double expected = (truth[i].Center() - truth[0].Center()).norm();
    EXPECT_NEAR(scale * (centers[i] - centers[0]).norm(), expected, 0.01 + 0.01 * expected) << i;
  }
}

TEST(Frontend, WhatCannotBeEmittedInTheMappingThreadIsToldToTheCaller) {
  SyntheticScene scene(12000, -1.5, 6, 0.1, 6);
  int records = 0;
  Frontend frontend(Replay::Options(true), scene.Camera(), {}, nullptr, [&](int64_t, RecordBody) {
    if (++records > 8) throw std::runtime_error("disk full");
  });
  EXPECT_THROW(
      {
        for (int i = 0; i < 30; ++i) frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), i));
        frontend.Finish();
      },
      std::runtime_error);
}

// A place that looks like a small part of the map (a poster hung twice) is not the place: the rest of what should be in
// view is not there.
TEST(Frontend, APoseThatFewOfTheVisiblePointsSupportIsNotBelieved) {
  SyntheticScene scene(40000, -1.5, 6, 0.1, 6);
  SyntheticScene elsewhere(40000, -1.5, 6, 0.1, 7);
  Replay run(scene);
  for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), i));
  const Rigid3 pose = NadirPose(0.9, 0.05);
  const FramePtr poster = scene.View(pose, 12), background = elsewhere.View(pose, 12);
  const auto add = [](const Frame& from, int i, Frame* to) {
    to->features.keypoints.push_back(from.features.keypoints[i]);
    to->features.descriptors.push_back(from.features.descriptors[i]);
    to->features.colors.push_back(from.features.colors[i]);
  };
  for (const int every : {1, 30}) {  // the whole place is recognised, a thirtieth of it is not
    auto frame = std::make_shared<Frame>(*background);
    frame->features = {};
    for (int i = 0; i < poster->features.Size(); i += every) add(*poster, i, frame.get());
    const int num_known = frame->features.Size();
    for (int i = num_known; i < background->features.Size(); ++i) add(*background, i, frame.get());
    frame->grid = FeatureGrid(frame->features.keypoints, scene.Camera().width, scene.Camera().height);
    EXPECT_GE(num_known, 30);
    const FrameOutcome outcome = run.frontend.ProcessFrame(frame);
    EXPECT_EQ(outcome.state == FrontendState::kTracking, every == 1)
        << outcome.num_inliers << " " << ToString(outcome.reason);
  }
}

// Three dozen points over the whole image fix a pose to 0.2 % of the height; as many in one place of it do not.
TEST(Frontend, APoseThatItsPointsLeaveOpenIsNotBelieved) {
  for (const double part : {1.0, 0.35}) {
    SyntheticScene scene(9000, -1.5, 6, 0.05, 6);
    FrontendOptions options;
    options.tracker.max_position_sigma = 0.004;
    Replay run(scene, options);
    for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), i));
    const FramePtr view = scene.View(NadirPose(0.9, 0.05), 12);
    auto frame = std::make_shared<Frame>(*view);
    frame->features = {};
    const Pinhole& camera = scene.Camera();
    for (int i = 0; i < view->features.Size() && frame->features.Size() < 36; ++i) {
      const Keypoint& keypoint = view->features.keypoints[i];
      if (std::abs(keypoint.pixel.x() - camera.cx) > part * camera.cx) continue;
      if (std::abs(keypoint.pixel.y() - camera.cy) > part * camera.cy) continue;
      frame->features.keypoints.push_back(keypoint);
      frame->features.descriptors.push_back(view->features.descriptors[i]);
      frame->features.colors.push_back(view->features.colors[i]);
    }
    ASSERT_EQ(frame->features.Size(), 36);
    frame->grid = FeatureGrid(frame->features.keypoints, camera.width, camera.height);
    const FrameOutcome outcome = run.frontend.ProcessFrame(frame);
    EXPECT_EQ(outcome.state == FrontendState::kTracking, part == 1.0) << part;
    EXPECT_EQ(outcome.reason, part == 1.0 ? LossReason::kNone : LossReason::kUnsupportedPose);
  }
}

// Around a loss the last keyframes before it and the first behind it get wide features; a submap that nothing needs to
// be joined to gets none.
TEST_P(FrontendThreads, WideFeaturesAreToldAroundALossOnly) {
  SyntheticScene scene(30000, -2, 14, 0.1, 2);
  const auto fly = [&](bool loss, int* num_extracted) {
    Replay run(scene, GetParam());
    run.frontend.ExtractWideFeatures([num_extracted](const cv::Mat& image) {
      ++*num_extracted;
      WideFeatures features;
      features.keypoints.resize(1);
      features.keypoints[0].pixel.x() = image.at<float>(0, 0);
      features.descriptors.resize(1);
      return features;
    });
    int index = 0;
    const auto see = [&](const Rigid3& pose) {
      const auto frame = scene.View(pose, index);
      frame->image = std::make_shared<const cv::Mat>(1, 1, CV_32F, cv::Scalar(index));
      run.frontend.ProcessFrame(frame);
      ++index;
    };
    for (int i = 0; i < 20; ++i) see(NadirPose(0.12 * i, 0));
    for (int i = 0; loss && i < 20; ++i) see(NadirPose(8 + 0.12 * i, 8));
    run.frontend.Finish();
    return std::move(run.session);
  };
  int num_extracted = 0;
  const Session whole = fly(false, &num_extracted);
  EXPECT_EQ(whole.submaps.size(), 1u);
  EXPECT_EQ(num_extracted, 0) << "nothing costs anything";
  const Session torn = fly(true, &num_extracted);
  ASSERT_EQ(torn.submaps.size(), 2u);
  for (const auto& [id, submap] : torn.submaps) {
    EXPECT_GE(submap.wide.size(), 3u);
    EXPECT_LE(submap.wide.size(), 16u);
    for (const auto& [keyframe, wide] : submap.wide) {
      const auto it = submap.keyframes.find(keyframe);
      if (it == submap.keyframes.end()) continue;
      EXPECT_EQ(wide.features->keypoints[0].pixel.x(), static_cast<float>(it->second.frame)) << "of its own image";
      EXPECT_EQ(wide.utime, it->second.utime);
    }
  }
  const Submap &before = torn.submaps.at(SubmapId(0)), &behind = torn.submaps.at(SubmapId(1));
  EXPECT_TRUE(before.wide.contains(before.keyframes.rbegin()->first)) << "the last one before the loss";
  EXPECT_TRUE(behind.wide.contains(behind.keyframes.begin()->first)) << "the first one behind it";
}

// Extraction takes as long as it takes: where nothing depends on timing, the order of the records does not either.
TEST(Frontend, WideFeaturesComeAtTheSamePlaceInTheStreamHoweverLongTheyTake) {
  std::vector<std::vector<std::string>> streams;
  for (const int delay_ms : {0, 30}) {
    SyntheticScene scene(30000, -2, 14, 0.1, 2);
    std::vector<std::string>& stream = streams.emplace_back();
    Frontend frontend({}, scene.Camera(), {}, nullptr, [&](int64_t utime, RecordBody body) {
      stream.push_back(std::to_string(body.index()) + " " + std::to_string(utime));
    });
    frontend.ExtractWideFeatures([delay_ms](const cv::Mat&) {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
      return WideFeatures();
    });
    int index = 0;
    for (const double y : {0.0, 8.0}) {
      for (int i = 0; i < 30; ++i) {
        const auto frame = scene.View(NadirPose(y + 0.12 * i, y), index++);
        frame->image = std::make_shared<const cv::Mat>(1, 1, CV_8U);
        frontend.ProcessFrame(frame);
      }
    }
    frontend.Finish();
  }
  EXPECT_EQ(streams[0], streams[1]);
  const auto is_wide = [](const std::string& line) { return line.starts_with("6 "); };
  const auto first = std::find_if(streams[0].begin(), streams[0].end(), is_wide);
  ASSERT_NE(first, streams[0].end());
  EXPECT_TRUE(std::any_of(first, streams[0].end(), [&](const std::string& line) { return !is_wide(line); }))
      << "told during the flight, not at its end";
}

TEST(Frontend, EqualInputGivesEqualRecords) {
  const auto poses = [] {
    SyntheticScene scene(8000, -1.5, 4, 0.1, 5);
    Replay run(scene);
    for (int i = 0; i < 12; ++i) run.frontend.ProcessFrame(scene.View(NadirPose(0.12 * i, 0), i));
    run.frontend.Finish();
    std::vector<double> values;
    for (const auto& [id, keyframe] : run.session.submaps.begin()->second.keyframes) {
      for (const double v : ToArray(keyframe.cam_from_submap)) values.push_back(v);
    }
    return values;
  };
  EXPECT_EQ(poses(), poses());
}

}  // namespace frontend_test
}  // namespace mapmend

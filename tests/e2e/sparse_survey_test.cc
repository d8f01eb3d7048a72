// A survey whose photos overlap by half: each fourth photo of the bundled flight. From one to the next the camera moves
// by some 210 of 600 pixels, which ORB does not follow.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "libs/geometry/alignment.h"
#include "libs/geometry/trajectory_file.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace sparse_survey_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
constexpr int kNumPhotos = 20;

CommandResult Map(const std::string& out, const std::vector<std::string>& more) {
  std::vector<std::string> argv = {kProgram,
                                   "run",
                                   kFlight + "video.mp4",
                                   "--camera",
                                   kFlight + "camera.yaml",
                                   "--times",
                                   kFlight + "times.txt",
                                   "--every",
                                   "4",
                                   "--end",
                                   "480",
                                   "--out",
                                   out,
                                   "--port",
                                   "0",
                                   "--seed",
                                   "1"};
  argv.insert(argv.end(), more.begin(), more.end());
  return RunCommand(argv, kPatienceS);
}

nlohmann::json SummaryOf(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }

TEST(SparseSurvey, IsOneExactMapWithAnImageForEachKeyframe) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  const CommandResult run = Map(out, {});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json summary = SummaryOf(out);
  EXPECT_EQ(summary.at("frames_in"), kNumPhotos);
  EXPECT_EQ(summary.at("frames_in_main"), kNumPhotos);
  const Evaluation evaluation = EvaluateTrajectory(ReadTrajectory(out + "/frames.tum"),
                                                   ReadTrajectory(kFlight + "groundtruth.tum"), EvaluationOptions());
  ASSERT_TRUE(evaluation.success) << evaluation.reason;
  EXPECT_LE(evaluation.rmse, 0.3);
  const CommandResult info = RunCommand({kProgram, "db", "info", out}, kPatienceS);
  const std::string num_keyframes = std::to_string(summary.at("keyframes_total").get<int>());
  EXPECT_NE(info.output.find("images of " + num_keyframes + " of " + num_keyframes + " keyframes"), std::string::npos)
      << info.output;
}

// With the option's value out of reach, photos are what a video is: what is left then shows what the test is for.
TEST(SparseSurvey, IsHardlyMappedByOrbAlone) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  Map(out, {"--set", "frontend.sparse.min_interval_s=1000"});
  EXPECT_LT(SummaryOf(out).at("frames_in_main"), kNumPhotos / 2);
}

}  // namespace sparse_survey_test
}  // namespace mapmend

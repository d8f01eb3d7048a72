// Two flights of different days, one map: the second is mapped into the folder of the first.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "libs/geometry/alignment.h"
#include "libs/geometry/trajectory_file.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace append_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

TEST(Append, TheSecondFlightJoinsTheMapOfTheFirst) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  const auto run = [&](const std::string& skipped, const std::vector<std::string>& more) {
    std::vector<std::string> argv = {kProgram,
                                     "run",
                                     kFlight + "video.mp4",
                                     "--skip-frames",
                                     skipped,
                                     "--out",
                                     out,
                                     "--port",
                                     "0",
                                     "--seed",
                                     "1",
                                     "--camera",
                                     kFlight + "camera.yaml",
                                     "--times",
                                     kFlight + "times.txt"};
    argv.insert(argv.end(), more.begin(), more.end());
    return RunCommand(argv, kPatienceS);
  };
  // The last strip of the first flight, and the first strips of the second, which crosses it.
  const CommandResult first = run("0-55,81-171", {});
  ASSERT_EQ(first.exit_code, 0) << first.output;
  const CommandResult second = run("0-80,106-171", {"--append"});
  ASSERT_EQ(second.exit_code, 0) << second.output;

  const nlohmann::json summary = nlohmann::json::parse(ReadText(out + "/summary.json"));
  EXPECT_EQ(summary.at("sessions").size(), 2u);
  EXPECT_EQ(summary.at("frames_in"), 50);
  EXPECT_EQ(summary.at("components").size(), 1u);
  const Evaluation evaluation = EvaluateTrajectory(ReadTrajectory(out + "/frames.tum"),
                                                   ReadTrajectory(kFlight + "groundtruth.tum"), EvaluationOptions());
  ASSERT_TRUE(evaluation.success) << evaluation.reason;
  EXPECT_GE(evaluation.num_estimate, 45u);
  EXPECT_LE(evaluation.rmse, 1.0);
}

}  // namespace append_test
}  // namespace mapmend

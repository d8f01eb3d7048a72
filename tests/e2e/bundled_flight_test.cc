// The demo as a test: the bundled flight, recorded while it is mapped, then mapped again from the recording.

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "libs/geometry/alignment.h"
#include "libs/geometry/trajectory_file.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace bundled_flight_test {

using Json = nlohmann::json;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

class BundledFlight : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    // The frames around the break are left out: without them tracking cannot but be lost.
    // Port 0: no live page, so that a page that is open elsewhere is left alone.
    result_ = RunCommand({kProgram, "run", kFlight + "video.mp4", "--camera", kFlight + "camera.yaml", "--times",
                          kFlight + "times.txt", "--skip-frames", "74-83", "--groundtruth", kFlight + "groundtruth.tum",
                          "--out", Out(), "--record", *folder_ / "log", "--seed", "1", "--port", "0"},
                         900);
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Out() { return *folder_ / "run"; }
  static Json Summary(const std::string& out) {
    const std::string text = ReadText(out + "/summary.json");
    return text.empty() ? Json::object() : Json::parse(text);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static CommandResult result_;
};

std::unique_ptr<TemporaryFolder> BundledFlight::folder_;
CommandResult BundledFlight::result_;

TEST_F(BundledFlight, EndsWithBothFlightsInOneMap) {
  ASSERT_EQ(result_.exit_code, 0) << result_.output;
  const Json summary = Summary(Out());
  EXPECT_EQ(summary.at("frames_in"), 162);
  EXPECT_GE(summary.at("submaps").size(), 2u);
  EXPECT_EQ(summary.at("components").size(), 1u);
  EXPECT_GE(summary.at("frames_in_main").get<int>(), 162 * 95 / 100);
  EXPECT_GE(summary.at("losses"), 1);

  // Every frame of the main map once, placed within a metre of the truth.
  const Evaluation evaluation = EvaluateTrajectory(ReadTrajectory(Out() + "/frames.tum"),
                                                   ReadTrajectory(kFlight + "groundtruth.tum"), EvaluationOptions());
  ASSERT_TRUE(evaluation.success) << evaluation.reason;
  EXPECT_EQ(evaluation.num_estimate, summary.at("frames_in_main").get<size_t>());
  EXPECT_GE(evaluation.coverage, 0.95 * 162 / 172);
  EXPECT_LE(evaluation.rmse, 1.0);
}

TEST_F(BundledFlight, TellsWhatItCost) {
  ASSERT_EQ(result_.exit_code, 0);
  const Json summary = Summary(Out());
  EXPECT_GT(summary.at("wall_s").get<double>(), 0);
  EXPECT_GT(summary.at("frontend").at("track_ms_median").get<double>(), 0);
  EXPECT_GE(summary.at("frontend").at("track_ms_p95"), summary.at("frontend").at("track_ms_median"));
  std::vector<std::string> names;
  for (const Json& process : summary.at("processes")) {
    names.push_back(process.at("name"));
    EXPECT_GT(process.at("cpu_s").get<double>(), 0) << names.back();
    EXPECT_GT(process.at("peak_rss_mb").get<double>(), 1) << names.back();
  }
  EXPECT_EQ(names, (std::vector<std::string>{"hub", "submap_store", "merger", "mosaic", "viewer_export", "lcm-logger",
                                             "frontend"}));
}

TEST_F(BundledFlight, WritesEveryFileThatOthersRelyOn) {
  ASSERT_EQ(result_.exit_code, 0);
  for (const char* name : {"map.db", "frames.tum", "keyframes.tum", "submaps/0/frames.tum", "submaps/1/frames.tum",
                           "map.ply", "graph.dot", "graph.svg", "trajectory.svg", "report.html", "summary.json"}) {
    EXPECT_GT(ReadText(Out() + "/" + name).size(), 0u) << name;
  }
  EXPECT_NE(ReadText(Out() + "/report.html").find("</html>"), std::string::npos);
}

TEST_F(BundledFlight, AReplayEndsWithTheSameMap) {
  ASSERT_EQ(result_.exit_code, 0);
  const std::string out = *folder_ / "replay";
  const CommandResult replay = RunCommand({kProgram, "replay", *folder_ / "log/mapmend.lcmlog", "--out", out,
                                           "--groundtruth", kFlight + "groundtruth.tum", "--seed", "1"},
                                          900);
  ASSERT_EQ(replay.exit_code, 0) << replay.output;
  const Json first = Summary(Out()), second = Summary(out);
  for (const char* key :
       {"submaps", "components", "connections", "frames_in", "frames_tracked", "keyframes_total", "points_in_main"}) {
    EXPECT_EQ(first.at(key), second.at(key)) << key;
  }
  EXPECT_EQ(ReadText(Out() + "/frames.tum"), ReadText(out + "/frames.tum"));
  EXPECT_EQ(ReadText(Out() + "/map.ply"), ReadText(out + "/map.ply"));
}

}  // namespace bundled_flight_test
}  // namespace mapmend

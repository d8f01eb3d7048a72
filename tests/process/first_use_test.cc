// What a person or a program sees around a run: one flight is mapped, then looked at with the other commands.

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace first_use_test {

using Json = nlohmann::json;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

CommandResult Call(const std::vector<std::string>& words) {
  std::vector<std::string> command = {kProgram};
  command.insert(command.end(), words.begin(), words.end());
  return RunCommand(command, kPatienceS);
}

std::vector<std::string> RunWords(const std::string& out, const std::vector<std::string>& more) {
  std::vector<std::string> words = {"run",           kFlight + "video.mp4",
                                    "--camera",      kFlight + "camera.yaml",
                                    "--out",         out,
                                    "--skip-frames", "12-171",
                                    "--port",        "0",
                                    "--mosaic",      "none"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class FirstUseTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    run_ = Call(RunWords(Out(), {"--json", "--title", "Monday <1>"}));
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Out() { return *folder_ / "out"; }

  static std::unique_ptr<TemporaryFolder> folder_;
  static CommandResult run_;
};

std::unique_ptr<TemporaryFolder> FirstUseTest::folder_;
CommandResult FirstUseTest::run_;

TEST_F(FirstUseTest, WithJsonNothingElseIsPrinted) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  const Json summary = Json::parse(run_.output);
  EXPECT_EQ(summary.at("frames_in_main"), 12);
  EXPECT_EQ(summary.at("title"), "Monday <1>");
  EXPECT_EQ(summary, Json::parse(ReadText(Out() + "/summary.json")));
}

TEST_F(FirstUseTest, TheReportHasItsTitleAndNamesPieces) {
  const std::string report = ReadText(Out() + "/report.html");
  EXPECT_NE(report.find("<h1>Monday &lt;1&gt;</h1>"), std::string::npos);
  EXPECT_NE(report.find("The map is in one piece"), std::string::npos);
}

TEST_F(FirstUseTest, QuietPrintsNothing) {
  const CommandResult result = Call(RunWords(*folder_ / "quiet", {"--quiet"}));
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.output, "");
}

TEST_F(FirstUseTest, StatusOfARunThatHasEndedSaysSoAndEnds) {
  EXPECT_FALSE(std::filesystem::exists(Out() + "/logs/lcm-url"));
  const CommandResult status = Call({"status", Out()});
  EXPECT_EQ(status.exit_code, 0);
  EXPECT_EQ(status.output, "the run in " + Out() +
                               " has ended: one piece, 12 of 12 frames in the main map; L1 –, L2 A; report " + Out() +
                               "/report.html\n");
  EXPECT_TRUE(Json::parse(Call({"status", Out(), "--json"}).output).at("ended"));
  const CommandResult none = Call({"status", folder_->Path()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.output.find("holds no run"), std::string::npos) << none.output;
}

TEST_F(FirstUseTest, StatusFollowsARunToItsEnd) {
  const std::string out = *folder_ / "followed";
  std::vector<std::string> words = RunWords(out, {"--quiet"});
  words.insert(words.begin(), kProgram);
  RunningCommand run(words, *folder_ / "run_output");
  ASSERT_TRUE(WaitUntil([&] { return std::filesystem::exists(out + "/logs/lcm-url"); }, 60));
  RunningCommand status({kProgram, "status", out}, *folder_ / "status_output");
  const auto ended = status.Wait(kPatienceS);
  ASSERT_TRUE(ended.has_value());
  EXPECT_EQ(ended->exit_code, 0) << ended->output;
  EXPECT_NE(ended->output.find("has ended: one piece"), std::string::npos) << ended->output;
  EXPECT_EQ(ended->output.find("process "), ended->output.rfind("process ")) << "a pipe gets one heading";
  EXPECT_EQ(run.Wait(60)->exit_code, 0);
}

TEST_F(FirstUseTest, DatabaseCommandsTakeTheFolder) {
  const CommandResult info = Call({"db", "info", Out()});
  EXPECT_EQ(info.exit_code, 0) << info.output;
  EXPECT_NE(info.output.find("session "), std::string::npos) << info.output;
  const Json json = Json::parse(Call({"db", "info", Out(), "--json"}).output);
  EXPECT_EQ(json.at("sessions").size(), 1u);
  EXPECT_EQ(json.at("sessions")[0].at("submaps").size(), 1u);
  EXPECT_EQ(json.at("merged").at("components"), 1);
  EXPECT_EQ(Call({"db", "check", Out()}).exit_code, 0);
  const CommandResult none = Call({"db", "info", folder_->Path()});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_EQ(none.output, "mapmend: db: " + folder_->Path() + ": the folder holds no map.db\n");
}

TEST_F(FirstUseTest, EdgesAsJson) {
  const CommandResult edges = Call({"edges", "list", Out(), "--json"});
  ASSERT_EQ(edges.exit_code, 0) << edges.output;
  const Json json = Json::parse(edges.output);
  EXPECT_EQ(json.at("submaps").size(), 1u);
  EXPECT_TRUE(json.at("final"));
}

TEST_F(FirstUseTest, ExportsKeepTheFormatsAndTheFrameThatTheyWereTold) {
  const std::string before = ReadText(Out() + "/frames.tum");
  ASSERT_EQ(Call({"export", Out(), "--format", "mcap,g2o", "--frame", "level"}).exit_code, 0);
  EXPECT_EQ(Json::parse(ReadText(Out() + "/summary.json")).at("frame"), "level");
  const std::string level = ReadText(Out() + "/frames.tum"), mcap = ReadText(Out() + "/map.mcap");
  EXPECT_NE(level, before);
  EXPECT_FALSE(mcap.empty());
  // Merged anew: the exports are made in another place, and put here when all of it is complete.
  ASSERT_EQ(Call({"merge", Out()}).exit_code, 0);
  EXPECT_EQ(ReadText(Out() + "/frames.tum"), level);
  EXPECT_EQ(ReadText(Out() + "/map.mcap"), mcap);
  ASSERT_EQ(Call({"export", Out(), "--frame", "map"}).exit_code, 0);
  EXPECT_EQ(ReadText(Out() + "/frames.tum"), before);
  EXPECT_NE(ReadText(Out() + "/map.mcap"), mcap) << "formats that are there are kept up to date";
}

TEST_F(FirstUseTest, AMapThatCannotTellItsCameraIsNoCalibration) {
  const CommandResult result = Call({"calibrate", Out()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.output.find("focal length"), std::string::npos) << result.output;
  EXPECT_FALSE(std::filesystem::exists(Out() + "/calibrated_camera.yaml"));
}

TEST(UsageTest, AMistakeInTheCommandLineIsOneLineAndTwo) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> mistakes = {
      {{"rnu", "a.mp4"}, "mapmend: no command 'rnu'; did you mean run?"},
      {{"run", "a.mp4", "--camra", "c.yaml"}, "mapmend: run: no option --camra; did you mean --camera?"},
      {{"db", "inof", "map.db"}, "mapmend: db: no command 'inof'; did you mean info?"},
      {{"db", "info"}, "mapmend: db info: FILE is missing"},
      {{"hub", "--prot", "1"}, "mapmend: hub: no option --prot; did you mean --port?"},
      {{"simulate", "--out", "x", "--sede", "1"}, "mapmend: simulate: no option --sede; did you mean --seed?"},
      {{"vocab", "info"}, "mapmend: vocab info: FILE is missing"},
      {{"export", "x", "--format", "las,mcpa"},
       "mapmend: --format: no format 'mcpa'; did you mean mcap? (there are tum, ply, colmap, kitti, euroc, las, g2o, "
       "gltf, mcap)"},
      {{"run", "a.mp4", "--format", "pdf"}, "mapmend: --format: no format 'pdf'"},
      {{"run", "a.mp4", "--frame", "levl"}, "mapmend: run: --frame: levl not in {map,level"},
      {{"run", "--speed", "2", "--live", "--camera", kFlight + "camera.yaml"}, "mapmend: --speed needs --realtime"}};
  for (const auto& [words, line] : mistakes) {
    const CommandResult result = Call(words);
    EXPECT_EQ(result.exit_code, 2) << line;
    EXPECT_TRUE(result.output.starts_with(line)) << result.output;
    EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
  }
  for (const char* program : {"frontend", "submap_store", "merger", "viewer_export"}) {
    const CommandResult result = RunCommand({std::string(MAPMEND_BIN_DIR) + "/" + program, "--nonsense"});
    EXPECT_EQ(result.exit_code, 2) << program;
    EXPECT_TRUE(result.output.starts_with(std::string(program) + ": no option --nonsense")) << result.output;
  }
}

TEST(UsageTest, HelpNamesTheCommandThatWasCalled) {
  for (const char* command : {"run", "db", "simulate", "hub"}) {
    const CommandResult result = Call({command, "--help"});
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_NE(result.output.find(std::string("Usage: mapmend ") + command), std::string::npos) << result.output;
  }
}

}  // namespace first_use_test
}  // namespace mapmend

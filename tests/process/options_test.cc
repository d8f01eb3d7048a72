// --config, --set and --print-config of every process, and of the commands that start them.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "libs/command_line/option_flags.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace options_test {

using testing::HasSubstr;

const std::string kBin = MAPMEND_BIN_DIR, kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

CommandResult Call(const std::string& program, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kBin + "/" + program);
  return RunCommand(arguments);
}

// Programs with options that are not mapmend itself.
std::vector<std::string> Processes() {
  std::vector<std::string> processes(std::begin(kConfigurablePrograms), std::end(kConfigurablePrograms));
  std::erase(processes, "mapmend");
  return processes;
}

class OptionsProcessTest : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& content) {
    std::ofstream(folder_ / name, std::ios::binary) << content;
    return folder_ / name;
  }
  // A mistake in the command line: one line, and exit code 2.
  static void ExpectMistake(const CommandResult& result, const std::string& line) {
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(result.output, line + "\n");
  }
  // Maps a few frames of the bundled flight into a folder of that name; returns the session's id and settings.
  std::pair<std::string, nlohmann::json> Fly(const std::string& out, const std::vector<std::string>& options) {
    std::vector<std::string> arguments = {
        "run", kFlight + "video.mp4", "--out", folder_ / out, "--skip-frames", "20-171", "--port", "0"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const CommandResult result = Call("mapmend", arguments);
    EXPECT_TRUE(result.exit_code == 0 || result.exit_code == 4) << result.output;
    SQLite::Database db(folder_ / out + "/map.db");
    SQLite::Statement session(db, "SELECT uuid, settings FROM session");
    if (!session.executeStep()) return {};
    return {session.getColumn(0).getString(), nlohmann::json::parse(session.getColumn(1).getString())};
  }

  TemporaryFolder folder_;
};

TEST_F(OptionsProcessTest, AMistakeIsToldInOneLine) {
  ExpectMistake(Call("frontend", {"--set", "tracker.min_inlier=30"}),
                "frontend: --set tracker.min_inlier: no such option; did you mean tracker.min_inliers?");
  ExpectMistake(Call("frontend", {"--set", "tracker.min_inliers=many"}),
                "frontend: --set tracker.min_inliers = many: 'many' is not a whole number");
  ExpectMistake(Call("merger", {"--set", "search.max_proposals=0"}),
                "merger: --set search.max_proposals = 0: must lie in 1 to 10000");
  ExpectMistake(Call("hub", {"--set", "max_clients"}), "mapmend: --set max_clients: expected NAME=VALUE");
  ExpectMistake(Call("submap_store", {"--set", "retrieval.thresholds.min_overlap=0.6", "--db", folder_ / "map.db"}),
                "submap_store: retrieval.thresholds: nearby_overlap must lie between min_overlap and max_overlap");
  EXPECT_FALSE(std::ifstream(folder_ / "map.db"));
}

TEST_F(OptionsProcessTest, AMistakeInAFileIsToldWithItsPlace) {
  const std::string unknown = Write("unknown.yaml", "search:\n  max_proposal: 3\n");
  ExpectMistake(
      Call("merger", {"--config", unknown}),
      "merger: --config " + unknown + ":2: search.max_proposal: no such option; did you mean search.max_proposals?");
  const std::string wrong = Write("wrong.yaml", "frontend:\n  tracker:\n    min_spread: wide\n");
  ExpectMistake(Call("frontend", {"--config", wrong}),
                "frontend: --config " + wrong + ":3: frontend.tracker.min_spread = wide: 'wide' is not a number");
  ExpectMistake(Call("merger", {"--config", folder_ / "none.yaml"}),
                "merger: --config " + folder_ / "none.yaml" + ": cannot be read");
}

TEST_F(OptionsProcessTest, FilesAndSettingsCountInTheirOrderAndFlagsWin) {
  const std::string file =
      Write("some.yaml", "merger.search:\n  max_proposals: 7\n  max_cached_keyframes: 300\nhub.port: 1\n");
  const auto changes = [](const std::vector<std::string>& arguments) {
    std::vector<std::string> all = arguments;
    all.emplace_back("--print-changes");
    return nlohmann::json::parse(Call("merger", all).output);
  };
  EXPECT_EQ(changes({}), nlohmann::json::object());
  EXPECT_EQ(changes({"--config", file})["search.max_proposals"], 7);
  EXPECT_EQ(changes({"--config", file, "--set", "search.max_proposals=9"})["search.max_proposals"], 9);
  EXPECT_EQ(changes({"--set", "merger.search.max_proposals=9", "--config", file})["search.max_proposals"], 7);
  EXPECT_EQ(changes({"--cache-keyframes", "200", "--config", file})["search.max_cached_keyframes"], 200);
}

TEST_F(OptionsProcessTest, WhatIsPrintedIsAFileOfTheDefaults) {
  const CommandResult all = Call("mapmend", {"options"});
  ASSERT_EQ(all.exit_code, 0) << all.output;
  const std::string file = Write("all.yaml", all.output);
  ASSERT_EQ(Processes().size(), 6u);
  for (const std::string& process : Processes()) {
    EXPECT_THAT("\n" + all.output, HasSubstr("\n" + process + ":\n")) << process;
    const CommandResult changes = Call(process, {"--config", file, "--print-changes"});
    EXPECT_EQ(changes.exit_code, 0);
    EXPECT_EQ(changes.output, "{}\n") << process;
  }
}

TEST_F(OptionsProcessTest, HelpTellsOfThem) {
  for (const std::string& process : Processes()) {
    const std::string help = Call(process, {"--help"}).output;
    for (const char* flag : {"--config FILE", "--set NAME=VALUE", "--print-config"})
      EXPECT_THAT(help, HasSubstr(flag)) << process;
  }
  for (const char* command : {"run", "fly", "replay", "merge", "station"}) {
    const std::string help = Call("mapmend", {command, "--help"}).output;
    for (const char* flag : {"--config FILE", "--set NAME=VALUE", "mapmend options"})
      EXPECT_THAT(help, HasSubstr(flag)) << command;
  }
}

TEST_F(OptionsProcessTest, TheDocsListThemAsTheyAre) {
  const CommandResult table = Call("mapmend", {"options", "--table"});
  ASSERT_EQ(table.exit_code, 0) << table.output;
  const std::string docs = ReadText(std::string(MAPMEND_SOURCE_DIR) + "/docs/options.md");
  const size_t begin = docs.find("## frontend\n");
  ASSERT_NE(begin, std::string::npos);
  EXPECT_TRUE(docs.substr(begin) == table.output)
      << "make docs/options.md anew: its tables are `mapmend options --table`";
}

TEST_F(OptionsProcessTest, AMistakeEndsARunBeforeAnythingIsStarted) {
  const auto expect = [&](const std::vector<std::string>& options, const std::string& line) {
    std::vector<std::string> arguments = {"run", kFlight + "video.mp4", "--out", folder_ / "out"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    ExpectMistake(Call("mapmend", arguments), "mapmend: " + line);
    EXPECT_FALSE(std::ifstream(folder_ / "out/logs/mapmend.log"));
  };
  expect({"--set", "frontend.tracker.min_inlier=30"},
         "--set frontend.tracker.min_inlier: no such option; did you mean frontend.tracker.min_inliers?");
  expect({"--set", "merger.search.max_proposals=-1"}, "--set merger.search.max_proposals = -1: must lie in 1 to 10000");
  expect({"--set", "mapmend.watchdog.silent_ms=never"},
         "--set mapmend.watchdog.silent_ms = never: 'never' is not a whole number");
  expect({"--set", "fronted.tracker.min_inliers=30"},
         "--set fronted.tracker.min_inliers=30: begins with no process of this command (frontend, hub, submap_store, "
         "merger, viewer_export, mosaic, mapmend); did you mean frontend?");
  const std::string file = Write("run.yaml", "merger:\n  graph.max_evidence: 50\nsearch.max_proposals: 3\n");
  expect({"--config", file}, "--config " + file +
                                 ":3: search.max_proposals: options stand under the name of their process (frontend, "
                                 "hub, submap_store, merger, viewer_export, mosaic, mapmend)");
  const std::string wrong = Write("wrong.yaml", "merger:\n  graph.max_evidences: 50\n");
  expect({"--config", wrong}, "--config " + wrong +
                                  ":2: merger.graph.max_evidences: no such option; did you mean "
                                  "merger.graph.max_evidence?");
  ExpectMistake(Call("mapmend", {"merge", folder_ / "none", "--set", "frontend.max_lost_frames=3"}),
                "mapmend: --set frontend.max_lost_frames=3: begins with no process of this command (hub, "
                "submap_store, merger, viewer_export, mosaic, mapmend)");
}

TEST_F(OptionsProcessTest, AFlightTellsItsOptionsAndIsNamedAfterThem) {
  const auto usual = Fly("usual", {});
  EXPECT_FALSE(usual.second.contains("options")) << usual.second;
  const auto same = Fly("same", {"--set", "frontend.tracker.min_spread=0.08"});
  EXPECT_EQ(same, usual);
  const std::string file =
      Write("flight.yaml", "frontend:\n  tracker:\n    min_spread: 0.09\nmerger:\n  search.max_proposals: 9\n");
  const auto other = Fly("other", {"--config", file});
  EXPECT_NE(other.first, usual.first);
  EXPECT_EQ(other.second["options"], nlohmann::json::parse(R"({"tracker.min_spread": 0.09})"));
}

}  // namespace options_test
}  // namespace mapmend

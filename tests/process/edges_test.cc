// `mapmend edges`, `export` and `merge`: on the results of a run, on a bare file, and on a system at work.

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace edges_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

CommandResult Call(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kProgram);
  return RunCommand(arguments, kPatienceS);
}
std::string Hash(const std::string& db) { return Call({"db", "hash", db}).output; }
nlohmann::json Summary(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }
bool Contains(const CommandResult& result, const std::string& text) {
  return result.output.find(text) != std::string::npos;
}

// Two submaps that one connection joins, and the recording of their flight.
class Edges : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const CommandResult run =
        Call({"run", kFlight + "video.mp4", "--skip-frames", "0-55,74-83,106-171", "--seed", "3", "--port", "0",
              "--mosaic", "none", "--out", *folder_ / "flown", "--record", *folder_ / "log"});
    ASSERT_EQ(run.exit_code, 0) << run.output;
    ASSERT_EQ(Summary(*folder_ / "flown").at("components").size(), 1u);
  }
  static void TearDownTestSuite() { delete folder_; }

  // A copy of the results that a test may change.
  std::string Copy(const std::string& name) const {
    std::filesystem::copy(*folder_ / "flown", *folder_ / name, std::filesystem::copy_options::recursive);
    return *folder_ / name;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* Edges::folder_ = nullptr;

TEST_F(Edges, OffAndOnAgainOnTheResultsOfARun) {
  const std::string out = Copy("off_and_on");
  const std::string before = Hash(out + "/map.db");
  const CommandResult list = Call({"edges", "list", out});
  ASSERT_EQ(list.exit_code, 0) << list.output;
  EXPECT_TRUE(Contains(list, "0 - 1")) << list.output;
  EXPECT_TRUE(Contains(list, "accepted    yes")) << list.output;
  EXPECT_TRUE(Contains(list, "2 submaps in 1 component, 1 connection in the tree")) << list.output;

  const CommandResult off = Call({"edges", "disable", out, "1", "0"});
  ASSERT_EQ(off.exit_code, 0) << off.output;
  EXPECT_TRUE(Contains(off, "deactivated")) << off.output;
  EXPECT_TRUE(Contains(off, "switched off by hand: 0 - 1")) << off.output;
  // The exports are made anew, and say why.
  EXPECT_EQ(Summary(out).at("components").size(), 2u);
  EXPECT_NE(ReadText(out + "/report.html").find("switched off by hand"), std::string::npos);
  EXPECT_NE(Hash(out + "/map.db"), before);
  const std::string without = Hash(out + "/map.db");

  // It survives that the map is merged anew, and saying it twice changes nothing.
  ASSERT_EQ(Call({"merge", out}).exit_code, 0);
  EXPECT_EQ(Hash(out + "/map.db"), without);
  const CommandResult again = Call({"edges", "disable", out, "0", "1"});
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_TRUE(Contains(again, "it is so already")) << again.output;

  const CommandResult on = Call({"edges", "enable", out, "0", "1"});
  ASSERT_EQ(on.exit_code, 0) << on.output;
  EXPECT_EQ(Summary(out).at("components").size(), 1u);
  EXPECT_EQ(Hash(out + "/map.db"), before);
}

TEST_F(Edges, AreShownAsPictures) {
  const std::string out = Copy("shown");
  const CommandResult shown = Call({"edges", "show", out, "0", "1"});
  ASSERT_EQ(shown.exit_code, 0) << shown.output;
  EXPECT_TRUE(Contains(shown, "accepted, in the tree: ")) << shown.output;
  EXPECT_TRUE(Contains(shown, "edges/0-1.png")) << shown.output;
  EXPECT_EQ(ReadText(out + "/edges/0-1.png").substr(1, 3), "PNG");
  // The same again, bit for bit, under another name.
  const std::string picture = *folder_ / "again.png";
  ASSERT_EQ(Call({"edges", "show", out, "1", "0", "--out", picture}).exit_code, 0);
  EXPECT_EQ(ReadText(picture), ReadText(out + "/edges/0-1.png"));
  EXPECT_NE(ReadText(out + "/report.html").find("data:image/jpeg;base64,/9j/"), std::string::npos);
  const CommandResult same = Call({"edges", "show", out, "0", "0"});
  EXPECT_EQ(same.exit_code, 1);
  EXPECT_TRUE(Contains(same, "name two different ones")) << same.output;
  const CommandResult unknown = Call({"edges", "show", out, "0", "7"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_TRUE(Contains(unknown, "there is no submap 7")) << unknown.output;
}

TEST_F(Edges, ABareDatabaseIsMergedAndExported) {
  const std::string db = *folder_ / "bare.db", exported = *folder_ / "exported";
  std::filesystem::copy(*folder_ / "flown/map.db", db);
  const std::string before = Hash(db);
  ASSERT_EQ(Call({"export", db, "--out", exported}).exit_code, 0);
  EXPECT_EQ(ReadText(exported + "/frames.tum"), ReadText(*folder_ / "flown/frames.tum"));
  EXPECT_EQ(ReadText(exported + "/map.ply"), ReadText(*folder_ / "flown/map.ply"));
  const CommandResult merge = Call({"merge", db});
  ASSERT_EQ(merge.exit_code, 0) << merge.output;
  EXPECT_EQ(Hash(db), before);
}

// What an earlier merger wrote does not outlive it. Without --seed the map is that of the flight's run.
TEST_F(Edges, MergedAnewNothingOldRemains) {
  const std::string out = Copy("anew"), db = out + "/map.db";
  const std::string before = Hash(db), frames = ReadText(out + "/frames.tum");
  ASSERT_EQ(Call({"merge", out, "--seed", "7"}).exit_code, 0);
  const std::string other_seed = Hash(db);
  EXPECT_NE(other_seed, before);
  ASSERT_EQ(Call({"db", "forget", db}).exit_code, 0);
  EXPECT_NE(Hash(db), other_seed);
  ASSERT_EQ(Call({"merge", out}).exit_code, 0);
  EXPECT_EQ(Hash(db), before);
  EXPECT_EQ(ReadText(out + "/frames.tum"), frames);
}

TEST_F(Edges, OnASystemAtWorkTheDecisionIsHeededToTheEnd) {
  const std::string out = *folder_ / "live";
  RunningCommand run(
      {kProgram, "replay", *folder_ / "log/mapmend.lcmlog", "--speed", "30", "--mosaic", "none", "--out", out},
      *folder_ / "live_output");
  CommandResult off;
  // As soon as there are two submaps.
  ASSERT_TRUE(WaitUntil(
      [&] {
        if (ReadText(out + "/logs/lcm-url").empty()) return false;
        off = Call({"edges", "disable", out, "0", "1"});
        return off.exit_code == 0;
      },
      60))
      << off.output << ReadText(*folder_ / "live_output");
  EXPECT_TRUE(Contains(off, "switched off by hand: 0 - 1")) << off.output;
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result);
  ASSERT_EQ(result->exit_code, 0) << result->output;
  const nlohmann::json summary = Summary(out);
  EXPECT_EQ(summary.at("components").size(), 2u);
  EXPECT_TRUE(summary.at("final").get<bool>());

  // The same map as if it had been decided afterwards.
  const std::string later = Copy("later");
  ASSERT_EQ(Call({"edges", "disable", later, "0", "1"}).exit_code, 0);
  EXPECT_EQ(Hash(out + "/map.db"), Hash(later + "/map.db"));
}

TEST_F(Edges, BadInputEndsInOneLine) {
  const std::string out = *folder_ / "flown";
  const std::string before = Hash(out + "/map.db");
  const auto expect_error = [&](const std::vector<std::string>& arguments, const std::string& text) {
    const CommandResult result = Call(arguments);
    EXPECT_EQ(result.exit_code, 1) << result.output;
    EXPECT_TRUE(Contains(result, text)) << result.output;
    EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
  };
  expect_error({"edges", "disable", out, "0", "7"}, "there is no submap 7");
  expect_error({"edges", "disable", out, "0", "x"}, "'x' is not a submap");
  expect_error({"edges", "disable", out, "1", "1"}, "two different ones");
  expect_error({"edges", "list", *folder_ / "nowhere"}, "no such file or folder");
  expect_error({"edges", "list", *folder_ / "log"}, "holds no map.db");
  expect_error({"export", out + "/map.db"}, "--out");
  expect_error({"export", out + "/summary.json", "--out", *folder_ / "x"}, "summary.json");
  EXPECT_EQ(Hash(out + "/map.db"), before);
}

}  // namespace edges_test
}  // namespace mapmend

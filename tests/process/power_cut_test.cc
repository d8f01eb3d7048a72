// Power cuts: SIGKILL for everything at once, at any moment of a flight. `recover` makes the map of all that had been
// tracked, `run --continue` maps the rest.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mapmend/frame_pose_t.hpp>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace power_cut_test {

namespace fs = std::filesystem;
const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
constexpr int kFrames = 91;  // of the part that is flown here

std::vector<std::string> RunArguments(const std::string& out, const std::vector<std::string>& more = {}) {
  std::vector<std::string> argv = {
      kProgram, "run", kFlight + "video.mp4", "--skip-frames", "0-39,131-171", "--seed", "1", "--port", "0",
      "--out",  out};
  argv.insert(argv.end(), more.begin(), more.end());
  return argv;
}

nlohmann::json Summary(const std::string& out) {
  const std::string text = ReadText(out + "/summary.json");
  return text.empty() ? nlohmann::json::object() : nlohmann::json::parse(text);
}

// -1 while there is no database.
int Count(const std::string& out, const std::string& what) {
  try {
    SQLite::Database database(out + "/map.db", SQLite::OPEN_READONLY, 2000);
    return database.execAndGet("SELECT count(*) FROM " + what).getInt();
  } catch (const SQLite::Exception&) {
    return -1;
  }
}

void CutPower(RunningCommand* run) {
  // Nobody may have the time to notice that another one is gone.
  const std::vector<pid_t> all = run->Survivors();
  for (const pid_t pid : all) kill(pid, SIGSTOP);
  for (const pid_t pid : all) kill(pid, SIGKILL);
  ASSERT_TRUE(run->Wait(10));
  ASSERT_EQ(run->SurvivorsAfter(10), std::vector<pid_t>());
}

// Frames that the map holds, of all submaps.
std::set<int> MappedFrames(const std::string& out) {
  std::set<int> frames;
  SQLite::Database database(out + "/map.db", SQLite::OPEN_READONLY, 2000);
  SQLite::Statement query(database, "SELECT frames FROM submap WHERE has_geometry = 1");
  constexpr int kFrameBytes = 72;  // docs/file_formats.md
  while (query.executeStep()) {
    const SQLite::Column blob = query.getColumn(0);
    for (int at = 0; at + kFrameBytes <= blob.getBytes(); at += kFrameBytes) {
      int32_t frame = 0;
      std::memcpy(&frame, static_cast<const char*>(blob.getBlob()) + at, sizeof(frame));
      frames.insert(frame);
    }
  }
  return frames;
}

TEST(PowerCut, RecoverMapsWhatTheStoreHadNotTakenYet) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return Count(out, "keyframe") >= 5; }, 90)) << ReadText(folder / "output");
  const pid_t store = FindProcess(run, "submap_store");
  ASSERT_GT(store, 0);
  kill(store, SIGSTOP);
  ASSERT_TRUE(WaitUntil([&] { return fs::file_size(out + "/outbox") > 300000; }, 60));
  CutPower(&run);
  const int stored = Count(out, "keyframe");
  const auto result = RunCommand({kProgram, "recover", out}, kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NE(result.output.find("/outbox: "), std::string::npos) << result.output;
  EXPECT_NE(result.output.find(" was cut off after frame "), std::string::npos) << result.output;
  EXPECT_GE(Count(out, "keyframe"), stored + 3);
  EXPECT_EQ(Count(out, "gap WHERE last_seq >= first_seq"), 0);  // an empty one marks that the store closed the session
  EXPECT_FALSE(fs::exists(out + "/outbox"));
  const nlohmann::json summary = Summary(out);
  ASSERT_TRUE(summary.contains("final")) << result.output;
  EXPECT_TRUE(summary.at("final").get<bool>());
  const std::set<int> mapped = MappedFrames(out);
  ASSERT_FALSE(mapped.empty());
  EXPECT_EQ(summary.at("frames_in").get<int>(), *mapped.rbegin() - 39) << "the forty that were skipped do not count";
  const auto again = RunCommand({kProgram, "recover", out}, 60);
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_NE(again.output.find("nothing to recover"), std::string::npos) << again.output;
}

TEST(PowerCut, MergeDeliversTheOutboxFirst) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return Count(out, "keyframe") >= 5; }, 90)) << ReadText(folder / "output");
  const pid_t store = FindProcess(run, "submap_store");
  ASSERT_GT(store, 0);
  kill(store, SIGSTOP);
  ASSERT_TRUE(WaitUntil([&] { return fs::file_size(out + "/outbox") > 300000; }, 60));
  CutPower(&run);
  const int stored = Count(out, "keyframe");
  const auto result = RunCommand({kProgram, "merge", out}, kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_GE(Count(out, "keyframe"), stored + 3);
  EXPECT_EQ(Count(out, "session WHERE ended = 0"), 0);
}

TEST(PowerCut, TheFlightGoesOnAfterIt) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  // Twice in one flight: the session is continued, and continued again.
  for (const int keyframes : {6, 30}) {
    RunningCommand run(
        RunArguments(out, keyframes > 6 ? std::vector<std::string>{"--continue"} : std::vector<std::string>{}),
        folder / "output");
    ASSERT_TRUE(WaitUntil([&] { return Count(out, "keyframe") >= keyframes; }, 120)) << ReadText(folder / "output");
    CutPower(&run);
  }
  const auto result = RunCommand(RunArguments(out, {"--continue"}), kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NE(result.output.find("going on with the flight at frame "), std::string::npos) << result.output;
  EXPECT_EQ(Count(out, "session"), 1);
  EXPECT_EQ(Count(out, "gap WHERE last_seq >= first_seq"), 0);  // an empty one marks that the store closed the session
  SQLite::Database database(out + "/map.db", SQLite::OPEN_READONLY);
  EXPECT_EQ(database.execAndGet("SELECT num_frames FROM session").getInt(), kFrames);
  const nlohmann::json summary = Summary(out);
  ASSERT_TRUE(summary.contains("frames_in_main")) << result.output;
  EXPECT_GE(summary.at("frames_in_main").get<int>(), kFrames - 4);
}

TEST(PowerCut, TheFlightGoesOnAfterItWasRecovered) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return Count(out, "keyframe") >= 12; }, 90)) << ReadText(folder / "output");
  CutPower(&run);
  ASSERT_EQ(RunCommand({kProgram, "recover", out}, kPatienceS).exit_code, 0);
  const auto result = RunCommand(RunArguments(out, {"--continue"}), kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_EQ(Count(out, "session"), 2);
  const nlohmann::json summary = Summary(out);
  ASSERT_TRUE(summary.contains("frames_in_main")) << result.output;
  EXPECT_GE(summary.at("frames_in_main").get<int>(), kFrames - 4);
}

// What a flight says of its frames, and when.
class PoseDiary {
 public:
  explicit PoseDiary(const std::string& url) : bus_(url, "") {
    subscription_ =
        bus_.Subscribe<frame_pose_t>(channels::kFramePose, Delivery::kKeepAll, [this](const frame_pose_t& pose) {
          poses_.push_back({Clock::now(), pose.frame, pose.state == "tracking" ? pose.submap : -1});
        });
  }
  void Listen(double seconds) {
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    while (Clock::now() < end) bus_.Handle(20);
  }
  // Tracked before that time. A submap that is not believed yet may be given up again: its first frames do not count.
  std::set<int> TrackedBefore(std::chrono::steady_clock::time_point time) const {
    constexpr size_t kBelieved = 4;
    std::set<int> frames;
    for (size_t begin = 0, end = 0; begin < poses_.size(); begin = end) {
      while (end < poses_.size() && poses_[end].submap == poses_[begin].submap) ++end;
      if (poses_[begin].submap < 0 || end - begin < kBelieved) continue;
      for (size_t i = begin; i < end; ++i) {
        if (poses_[i].heard < time) frames.insert(poses_[i].frame);
      }
    }
    return frames;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Pose {
    Clock::time_point heard;
    int frame, submap;  // -1: lost
  };
  Bus bus_;
  std::vector<Pose> poses_;
  Subscription subscription_;
};

// Two moments; MAPMEND_POWER_CUTS in the environment asks for more.
TEST(PowerCut, NothingIsLostThatWasTrackedASecondBefore) {
  const char* wanted = std::getenv("MAPMEND_POWER_CUTS");
  const int num_cuts = wanted != nullptr ? std::atoi(wanted) : 2;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> moment(2, 14);
  size_t num_checked = 0;
  for (int i = 0; i < num_cuts; ++i) {
    const TemporaryFolder folder;
    const std::string out = folder / "out";
    RunningCommand run(RunArguments(out, {"--realtime", "--speed", "8"}), folder / "output");
    ASSERT_TRUE(WaitUntil([&] { return ReadText(out + "/logs/lcm-url").size() > 5; }, 60));
    std::string url = ReadText(out + "/logs/lcm-url");
    url.pop_back();
    PoseDiary diary(url);
    diary.Listen(moment(random));
    const auto cut = std::chrono::steady_clock::now();
    CutPower(&run);
    const std::set<int> tracked = diary.TrackedBefore(cut - std::chrono::seconds(1));
    num_checked += tracked.size();
    const auto result = RunCommand({kProgram, "recover", out}, kPatienceS);
    if (result.exit_code == 1 && tracked.empty()) continue;  // nothing was stored yet
    EXPECT_EQ(result.exit_code, 0) << result.output;
    const std::set<int> mapped = MappedFrames(out);
    for (const int frame : tracked) EXPECT_TRUE(mapped.contains(frame)) << "cut " << i << ", frame " << frame;
  }
  EXPECT_GT(num_checked, 0u);
}

TEST(PowerCut, AFolderWithUndeliveredRecordsIsNotOverwritten) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  RunningCommand run(RunArguments(out, {"--realtime", "--speed", "30"}), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return Count(out, "keyframe") >= 3; }, 120)) << ReadText(folder / "output");
  // Again and again: on a busy machine the launcher has time to replace a store that does not answer.
  const auto is_full = [&] {
    if (const pid_t store = FindProcess(run, "submap_store"); store > 0) kill(store, SIGSTOP);
    return fs::exists(out + "/outbox") && fs::file_size(out + "/outbox") > 100000;
  };
  ASSERT_TRUE(WaitUntil(is_full, 60));
  CutPower(&run);
  const auto refused = RunCommand(RunArguments(out), 60);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.output.find("holds records of a flight that was cut off"), std::string::npos) << refused.output;
  EXPECT_GT(fs::file_size(out + "/outbox"), 100000u);
}

}  // namespace power_cut_test
}  // namespace mapmend

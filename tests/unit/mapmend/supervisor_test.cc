#include "procs/mapmend/supervisor.h"

#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

namespace mapmend {
namespace supervisor_test {

using std::chrono::milliseconds;
namespace fs = std::filesystem;

class SupervisorTest : public testing::Test {
 protected:
  SupervisorTest() {
    folder_ = fs::path(testing::TempDir()) / ("supervisor_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    options_.log_folder = folder_.string();
    options_.first_backoff_ms = 20;
    options_.stop_grace_ms = 200;
  }
  ~SupervisorTest() override { fs::remove_all(folder_); }

  ProcessSpec Shell(const std::string& name, const std::string& script, OnExit on_exit = OnExit::kRestart) {
    return {name, {"/bin/sh", "-c", script}, on_exit};
  }
  // Ticks until the condition holds; false after two seconds.
  template <typename Condition>
  bool TickUntil(Supervisor* supervisor, Condition condition) {
    for (int i = 0; i < 400; ++i) {
      supervisor->Tick();
      if (condition()) return true;
      std::this_thread::sleep_for(milliseconds(5));
    }
    return false;
  }
  static bool Exists(pid_t pid) { return kill(pid, 0) == 0; }

  fs::path folder_;
  SupervisorOptions options_;
};

TEST_F(SupervisorTest, StopsInReverseOrderAndLeavesNothingRunning) {
  Supervisor supervisor(options_);
  const std::string order = (folder_ / "order").string();
  for (const char* name : {"first", "second"}) {
    supervisor.Start(Shell(name, std::string("trap 'echo ") + name + " >> " + order +
                                     "; exit 0' TERM; echo up; while true; do sleep 0.01; done"));
  }
  const pid_t first = supervisor.Pid("first"), second = supervisor.Pid("second");
  ASSERT_TRUE(TickUntil(&supervisor, [&] {
    return fs::file_size(supervisor.LogPath("first")) > 0 && fs::file_size(supervisor.LogPath("second")) > 0;
  }));
  supervisor.StopAll();
  EXPECT_FALSE(Exists(first));
  EXPECT_FALSE(Exists(second));
  std::ifstream file(order);
  std::string a, b;
  file >> a >> b;
  EXPECT_EQ(a, "second");
  EXPECT_EQ(b, "first");
}

TEST_F(SupervisorTest, KillsWhatIgnoresSigterm) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("deaf", "trap '' TERM; echo up; while true; do sleep 0.01; done"));
  const pid_t pid = supervisor.Pid("deaf");
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return fs::file_size(supervisor.LogPath("deaf")) > 0; }));
  const auto start = std::chrono::steady_clock::now();
  supervisor.StopAll();
  EXPECT_GE(std::chrono::steady_clock::now() - start, milliseconds(200));
  EXPECT_FALSE(Exists(pid));
}

TEST_F(SupervisorTest, RestartsAReadyProcessAlsoAfterExitCodeZero) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("flaky", "echo start; sleep 0.05; exit 0"));
  const pid_t first = supervisor.Pid("flaky");
  supervisor.MarkReady("flaky", first);
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("flaky") == 2; }));
  EXPECT_NE(supervisor.Pid("flaky"), first);
}

TEST_F(SupervisorTest, AProcessThatNeverWasReadyEndsTheRunWithItsErrorLine) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("store", "echo starting; echo 'store: cannot open map.db: disk full'; echo more; exit 1"));
  try {
    TickUntil(&supervisor, [] { return false; });
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(), "store: cannot open map.db: disk full");
  }
}

TEST_F(SupervisorTest, AProcessThatKeepsEndingIsToldAndTriedForEver) {
  options_.first_backoff_ms = 1;
  options_.max_backoff_ms = 4;
  options_.max_quick_restarts = 2;
  Supervisor supervisor(options_);
  supervisor.Start(Shell("merger", "sleep 0.02; exit 3"));
  supervisor.MarkReady("merger", supervisor.Pid("merger"));
  std::vector<std::string> notices;
  ASSERT_TRUE(TickUntil(&supervisor, [&] {
    for (std::string& line : supervisor.TakeNotices()) notices.push_back(std::move(line));
    return supervisor.NumRestarts("merger") >= 6;
  }));
  EXPECT_TRUE(supervisor.IsFailing("merger"));
  EXPECT_EQ(notices, (std::vector<std::string>{
                         "merger ended with exit code 3; it is started again",
                         "merger ended 3 times in a row (merger ended with exit code 3); it is tried again now and "
                         "then"}));
}

TEST_F(SupervisorTest, AnOptionalProcessThatKeepsDyingIsLeftAloneForLonger) {
  options_.first_backoff_ms = 1;
  options_.max_backoff_ms = 4;
  options_.max_quick_restarts = 2;
  options_.optional_backoff_ms = 60000;
  Supervisor supervisor(options_);
  ProcessSpec viewer = Shell("viewer", "sleep 0.02; kill -KILL $$");
  viewer.need = Need::kStart;
  supervisor.Start(viewer);
  supervisor.MarkReady("viewer", supervisor.Pid("viewer"));
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("viewer") == 2; }));
  EXPECT_FALSE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("viewer") == 3; }));
  // Killed from outside: it may be sound.
  EXPECT_FALSE(supervisor.IsFailing("viewer"));
  supervisor.RestartNow("viewer");
  EXPECT_TRUE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("viewer") == 3; }));
}

TEST_F(SupervisorTest, AnExtraProcessThatCannotStartIsToldAndTriedAgain) {
  Supervisor supervisor(options_);
  ProcessSpec mosaic = Shell("mosaic", "echo 'mosaic: no room' >&2; exit 1");
  mosaic.need = Need::kExtra;
  supervisor.Start(mosaic);
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("mosaic") == 2; }));
  EXPECT_EQ(supervisor.TakeNotices(), std::vector<std::string>{"mosaic: no room; it is started again"});
}

TEST_F(SupervisorTest, WhatIsKilledBeforeItIsReadyIsStartedAgain) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("merger", "kill -KILL $$"));
  EXPECT_TRUE(TickUntil(&supervisor, [&] { return supervisor.NumRestarts("merger") == 2; }));
}

TEST_F(SupervisorTest, AFrontendThatIsKilledIsStartedAgainAndItsExitCodeKept) {
  Supervisor supervisor(options_);
  const std::string mark = (folder_ / "mark").string();
  supervisor.Start(
      Shell("frontend", "if [ -e " + mark + " ]; then exit 3; fi; touch " + mark + "; kill -KILL $$", OnExit::kResume));
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.Status("frontend").has_value(); }));
  EXPECT_EQ(supervisor.Status("frontend")->code, 3);
  EXPECT_EQ(supervisor.NumRestarts("frontend"), 1);
}

TEST_F(SupervisorTest, AFrontendThatCrashesEachTimeIsGivenUp) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("frontend", "ulimit -c 0; kill -SEGV $$", OnExit::kResume));
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.Status("frontend").has_value(); }));
  EXPECT_EQ(supervisor.Status("frontend")->signal, SIGSEGV);
  EXPECT_EQ(supervisor.NumRestarts("frontend"), options_.max_crashes);
}

TEST_F(SupervisorTest, ReportsTheStatusOfAProcessThatMayEnd) {
  Supervisor supervisor(options_);
  supervisor.Start(Shell("frontend", "exit 3", OnExit::kReport));
  supervisor.Start(Shell("crash", "kill -SEGV $$", OnExit::kReport));
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.Status("frontend") && supervisor.Status("crash"); }));
  EXPECT_EQ(supervisor.Status("frontend")->code, 3);
  EXPECT_EQ(supervisor.Status("crash")->signal, SIGSEGV);
  EXPECT_FALSE(supervisor.IsRunning("frontend"));
}

TEST_F(SupervisorTest, AddsUpWhatEveryIncarnationUsed) {
  // Memory is sampled every 100 ms: the child must live longer than that.
  Supervisor supervisor(options_);
  supervisor.Start(
      Shell("busy", "i=0; while [ $i -lt 60000 ]; do i=$((i+1)); done; sleep 0.4; exit 0", OnExit::kReport));
  ASSERT_TRUE(TickUntil(&supervisor, [&] { return supervisor.Status("busy").has_value(); }));
  const auto usage = supervisor.Usage();
  ASSERT_EQ(usage.size(), 1u);
  EXPECT_EQ(usage[0].first, "busy");
  EXPECT_GT(usage[0].second.cpu_s, 0.005);
  EXPECT_GT(usage[0].second.peak_rss_mb, 0.5);
}

TEST_F(SupervisorTest, NamesAProgramThatCannotBeStarted) {
  Supervisor supervisor(options_);
  try {
    supervisor.Start({"nothing", {"/no/such/program"}, OnExit::kRestart});
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_STREQ(e.what(), "cannot start /no/such/program: No such file or directory");
  }
}

TEST(FindErrorLine, PrefersTheFirstErrorAndStripsTheTimeStamp) {
  const std::string path = testing::TempDir() + "/find_error_line.log";
  std::ofstream(path) << "old error\n"
                      << "[2026-01-01 00:00:00.000] [info] reading\n"
                      << "[2026-01-01 00:00:01.000] [error] first cause\n"
                      << "viewer: second\n";
  EXPECT_EQ(FindErrorLine(path, "viewer", 0), "viewer: first cause");
  EXPECT_EQ(FindErrorLine(path, "merger", 10), "merger: first cause");
  std::ofstream(path) << "terminate called\n\n";
  EXPECT_EQ(FindErrorLine(path, "merger", 0), "merger: terminate called");
  std::ofstream(path, std::ios::trunc) << "";
  EXPECT_EQ(FindErrorLine(path, "merger", 0), "");
}

}  // namespace supervisor_test
}  // namespace mapmend

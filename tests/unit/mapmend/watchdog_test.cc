#include "procs/mapmend/watchdog.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <thread>

namespace mapmend {
namespace watchdog_test {

using std::chrono::milliseconds;
using Clock = Watchdog::Clock;

// A process that sleeps, or computes without end.
class Process {
 public:
  explicit Process(bool computes) : pid_(fork()) {
    if (pid_ != 0) return;
    for (;;) {
      if (!computes) pause();
    }
  }
  ~Process() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  pid_t Pid() const { return pid_; }

 private:
  pid_t pid_;
};

WatchdogOptions Impatient() {
  WatchdogOptions options;
  options.silent_ms = 200;
  options.newborn_ms = 600;
  options.min_cpu_ms = 20;
  return options;
}

// Whether the process is found to hang within limit_ms of silence.
bool Hangs(Watchdog* watchdog, pid_t pid, bool was_heard, int limit_ms) {
  const auto since = Clock::now();
  while (Clock::now() - since < milliseconds(limit_ms)) {
    if (!watchdog->Judge(pid, since, was_heard, 0).empty()) return true;
    std::this_thread::sleep_for(milliseconds(10));
  }
  return false;
}

TEST(Watchdog, OneThatDoesNothingAndSaysNothingHangs) {
  const Process process(false);
  Watchdog watchdog(Impatient());
  EXPECT_TRUE(Hangs(&watchdog, process.Pid(), true, 2000));
}

TEST(Watchdog, OneThatComputesDoesNotHangBeforeItHasBeenMuteForLong) {
  const Process process(true);
  WatchdogOptions options = Impatient();
  options.silent_ms = 1000;  // enough for it to get the processor on a busy machine
  options.mute_ms = 1000000;
  Watchdog patient(options);
  EXPECT_FALSE(Hangs(&patient, process.Pid(), true, 1500));
  options.mute_ms = 1200;
  Watchdog strict(options);
  EXPECT_TRUE(Hangs(&strict, process.Pid(), true, 3000));
}

TEST(Watchdog, AStoppedOneHangsEvenIfItHasNotSpokenYet) {
  const Process process(true);
  WatchdogOptions options = Impatient();
  options.newborn_ms = 1000000;
  Watchdog watchdog(options);
  kill(process.Pid(), SIGSTOP);
  EXPECT_TRUE(Hangs(&watchdog, process.Pid(), false, 2000));
}

TEST(Watchdog, OneThatWasJustBornHasMoreTime) {
  const Process process(false);
  WatchdogOptions options = Impatient();
  options.newborn_ms = 1000000;
  Watchdog watchdog(options);
  EXPECT_FALSE(Hangs(&watchdog, process.Pid(), false, 500));
}

TEST(Watchdog, SilenceIsCountedAnewWithEachWord) {
  const Process process(false);
  Watchdog watchdog(Impatient());
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(watchdog.Judge(process.Pid(), Clock::now(), true, 0), "");
    std::this_thread::sleep_for(milliseconds(10));
  }
}

TEST(Watchdog, OneThatSpeaksButDoesNotMoveOnHangs) {
  const Process process(false);
  Watchdog watchdog(Impatient());
  EXPECT_EQ(watchdog.Judge(process.Pid(), Clock::now(), true, 299), "");
  EXPECT_EQ(watchdog.Judge(process.Pid(), Clock::now(), true, 300), "its work has stood still for 300 s");
}

TEST(Watchdog, AProcessThatIsGoneIsSomebodyElsesBusiness) {
  pid_t pid = -1;
  {
    const Process process(false);
    pid = process.Pid();
  }
  Watchdog watchdog(Impatient());
  EXPECT_FALSE(Hangs(&watchdog, pid, true, 400));
}

}  // namespace watchdog_test
}  // namespace mapmend

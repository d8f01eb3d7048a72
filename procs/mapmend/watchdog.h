#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <string>

#include "libs/base/range.h"

namespace mapmend {

struct WatchdogOptions {
  int silent_ms = 7000;    // without a word and without having used the processor: it hangs
  int mute_ms = 60000;     // without a word although it works: nobody can tell what it does
  int newborn_ms = 30000;  // the same as silent_ms for one that has not said a word yet
  int stalled_s = 300;     // it speaks, but its work stands still (HealthReporter)
  int min_cpu_ms = 30;     // less in all that time is not work

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("silent_ms", silent_ms, Range(1, 3.6e6), "ms");
    v("mute_ms", mute_ms, Range(1, 3.6e6), "ms");
    v("newborn_ms", newborn_ms, Range(1, 3.6e6), "ms");
    v("stalled_s", stalled_s, Range(1, 1e6), "s");
    v("min_cpu_ms", min_cpu_ms, Range(0, 3.6e6), "ms");
  }
};

// Tells processes that hang (stopped, dead-locked) from those that only have much to do or get little of the processor.
// Everything is measured on the monotonic clock.
class Watchdog {
 public:
  using Clock = std::chrono::steady_clock;
  explicit Watchdog(const WatchdogOptions& options) : options_(options) {}

  // Why the process is to be taken for hung, for a person; empty: it is not, or that was said already.
  //   since      when it was last heard, or from when on it could have been
  //   was_heard  it has spoken before
  //   stalled_s  how long its work has stood still, as it says itself
  std::string Judge(pid_t pid, Clock::time_point since, bool was_heard, double stalled_s);

 private:
  struct Seen {
    Clock::time_point since;
    double cpu_ms = 0;  // it had used by then
    bool is_told = false;
  };
  WatchdogOptions options_;
  std::map<pid_t, Seen> seen_;
};

// What the kernel says of a process: state letter (R, S, D, T, Z ...) and the processor time of all its threads. state
// 0: there is no such process.
struct ProcessState {
  char state = 0;
  double cpu_ms = 0;
};
ProcessState ReadProcessState(pid_t pid);

}  // namespace mapmend

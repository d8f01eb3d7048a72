#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "procs/mapmend/child_process.h"

// Starts, watches, restarts and stops the processes of one run.
namespace mapmend {

// How much depends on a process.
enum class Need {
  kEssential,  // no flight without it
  kStart,      // the flight goes on without it, but it must have started once: longer pauses once it keeps ending
  kExtra,      // the flight goes on without it, whether it starts or not
};

// What to do when a process ends although nobody asked it to.
enum class OnExit {
  kRestart,  // start it again, with back-off: it recovers its state from the store
  kResume,   // the same after a signal, a few times in a row if it crashed; exit codes are kept as for kReport
  kReport,   // keep its status for the caller (the recorder)
};

struct ProcessSpec {
  std::string name;               // also the name of its log file
  std::vector<std::string> argv;  // argv[0] is a full path
  OnExit on_exit = OnExit::kRestart;
  Need need = Need::kEssential;
};

struct SupervisorOptions {
  std::string log_folder;      // must exist
  int first_backoff_ms = 100;  // before the first restart; doubles with each further one
  int max_backoff_ms = 5000;
  int stable_after_ms = 10000;      // a process that ran for so long starts over with the first back-off
  int max_quick_restarts = 6;       // ended so often without becoming stable: it is told, and counts as failing
  int optional_backoff_ms = 30000;  // of a process that is failing and not essential
  int max_crashes = 3;              // in a row, of a kResume process: then its status is kept
  int stop_grace_ms = 2000;         // between SIGTERM and SIGKILL

  // Not visited: log_folder: of one run.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("first_backoff_ms", first_backoff_ms, Range(1, 3.6e6), "ms");
    v("max_backoff_ms", max_backoff_ms, Range(1, 3.6e6), "ms");
    v("stable_after_ms", stable_after_ms, Range(0, 3.6e6), "ms");
    v("max_quick_restarts", max_quick_restarts, Range(0, 1e6));
    v("optional_backoff_ms", optional_backoff_ms, Range(0, 3.6e6), "ms");
    v("max_crashes", max_crashes, Range(0, 1e6));
    v("stop_grace_ms", stop_grace_ms, Range(0, 3.6e6), "ms");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
  // Empty, or which options contradict each other.
  std::string Conflict() const;
};

class Supervisor {
 public:
  explicit Supervisor(const SupervisorOptions& options);
  ~Supervisor();  // stops everything

  void Start(const ProcessSpec& spec);
  // The arguments for the next start of a process (the hub learns its port in the first).
  void ChangeArguments(const std::string& name, const std::vector<std::string>& argv);
  // The process has reported that it is ready: from now on its end is followed by a restart, for ever. Before, it is an
  // error unless it was killed or is an extra: what cannot start (a wrong file, a full disk) does not start the second
  // time either.
  void MarkReady(const std::string& name, pid_t pid);
  // Looks after every process; call at least ten times a second. Throws std::runtime_error with the process's own error
  // line if one cannot be started.
  void Tick();
  // A process that waits for its next start is started with the next Tick.
  void RestartNow(const std::string& name);
  // Ended by itself (not killed) more than max_quick_restarts times in a row.
  bool IsFailing(const std::string& name) const;
  // How it ended the last time, in one line; empty if it never did.
  std::string LastEnd(const std::string& name) const { return Find(name).last_end; }
  // Lines for the user that have come up since the last call.
  std::vector<std::string> TakeNotices() { return std::exchange(notices_, {}); }
  // Kills a process that has hung; Tick starts it again.
  void KillHung(const std::string& name);

  // Status of a kReport or kResume process that has ended for good; nullopt while it runs or is to be started again.
  std::optional<ExitStatus> Status(const std::string& name) const;
  bool IsRunning(const std::string& name) const;
  pid_t Pid(const std::string& name) const;  // -1 if it is not running
  std::chrono::steady_clock::time_point Started(const std::string& name) const { return Find(name).started; }
  int NumRestarts(const std::string& name) const;
  // The first error line that the last incarnation of a process has logged; empty without one.
  std::string ErrorLine(const std::string& name) const;
  std::string LogPath(const std::string& name) const;
  // Where in its log the output of a process's last incarnation begins, bytes.
  long LogStart(const std::string& name) const;

  // Stops one process (and does not restart it), or all in reverse order of their start.
  void Stop(const std::string& name);
  void StopAll();

  // Summed (CPU) and highest (memory) over all incarnations of each process that has ended, in order of start.
  std::vector<std::pair<std::string, ResourceUsage>> Usage() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Entry {
    ProcessSpec spec;
    std::unique_ptr<ChildProcess> child;
    std::optional<ExitStatus> status;  // of a kReport process
    bool was_ready = false;            // in any incarnation
    bool stopped = false;
    int num_restarts = 0, num_quick = 0, num_failures = 0;  // in a row: ends, and ends that were not a SIGKILL
    std::string last_end;
    long log_start = 0;  // where the last incarnation's output begins in the log
    Clock::time_point started, restart_at;
    ResourceUsage usage;
    double sampled_peak_mb = 0;  // of all incarnations, while they ran
  };

  Entry& Find(const std::string& name);
  const Entry& Find(const std::string& name) const;
  void Launch(Entry* entry);
  void OnEnd(Entry* entry, const ExitStatus& status);
  void PlanRestart(Entry* entry, const std::string& why);
  static void AddUsage(Entry* entry, const ExitStatus& status);
  static void SamplePeakMemory(Entry* entry);

  SupervisorOptions options_;
  std::vector<std::unique_ptr<Entry>> entries_;  // in order of start
  std::vector<std::string> notices_;
  Clock::time_point last_sample_;
};

// The first line of a log, from byte `from` on, that reports an error: "[error] ..." or "[critical] ..." of the logger,
// or "name: ..." of a program that gave up. Without the logger's time stamp; the last line that is not empty if none
// does.
std::string FindErrorLine(const std::string& log_path, const std::string& name, long from);

}  // namespace mapmend

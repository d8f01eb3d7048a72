#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

// One child process of the launcher. It runs in a process group of its own, so that Ctrl-C at the terminal reaches the
// launcher only (which stops its children in order), and is sent SIGTERM by the kernel should the launcher die.
// Standard input is /dev/null; standard output and error are appended to a log file.
namespace mapmend {

// What a process has used, from wait4. The kernel counts the launcher's own pages between fork and exec as the child's,
// so that peak_rss_mb of a small process is the launcher's own; the supervisor corrects that.
struct ResourceUsage {
  double cpu_s = 0;
  double peak_rss_mb = 0;
};

// How a process ended.
struct ExitStatus {
  int code = 0;    // exit code, if it exited by itself
  int signal = 0;  // the signal that ended it, else 0
  ResourceUsage usage;
  bool Success() const { return signal == 0 && code == 0; }
  std::string Describe() const;  // "exit code 1", "signal 9 (Killed)"
};

class ChildProcess {
 public:
  // Starts argv[0] with the arguments argv[1...]. Throws std::runtime_error naming the program or the log file.
  // Must be called from a thread that lives as long as the launcher (the kernel's notice follows the thread).
  ChildProcess(const std::vector<std::string>& argv, const std::string& log_path);
  // Kills the process if it is still running.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // The status once it has ended, nullopt while it runs.
  std::optional<ExitStatus> Poll();
  void Signal(int signal);
  // SIGTERM, and SIGKILL if it has not ended after grace_ms. Returns how it ended.
  ExitStatus Stop(int grace_ms);

  pid_t Pid() const { return pid_; }
  // Highest resident memory so far, as the kernel tells for a process that runs; 0 once it has ended.
  double ReadPeakRssMb() const;

 private:
  pid_t pid_ = -1;
  std::optional<ExitStatus> status_;
};

}  // namespace mapmend

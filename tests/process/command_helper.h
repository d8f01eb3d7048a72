#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

// Starting programs in tests as a person would: arguments in, exit code and text out, nothing left behind.
namespace mapmend {

struct CommandResult {
  int exit_code = -1;  // -1: it was ended by a signal
  int signal = 0;
  std::string output;  // standard output and error
};

// A program that runs beside the test. Every process it starts can be told by a mark in its environment.
class RunningCommand {
 public:
  // argv[0]: a full path. output_path: file that gets standard output and error.
  RunningCommand(const std::vector<std::string>& argv, const std::string& output_path);
  ~RunningCommand();  // kills what is left of it
  RunningCommand(const RunningCommand&) = delete;
  RunningCommand& operator=(const RunningCommand&) = delete;

  void Signal(int signal);
  // nullopt if it has not ended after timeout_s.
  std::optional<CommandResult> Wait(double timeout_s);
  // Processes that it has started, itself included, and that still run (zombies do not count).
  std::vector<pid_t> Survivors() const;
  // The same after up to timeout_s for them to go.
  std::vector<pid_t> SurvivorsAfter(double timeout_s) const;
  pid_t Pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  std::string mark_, output_path_;
  std::optional<CommandResult> result_;
};

// How long a flight or a command over a map may take, seconds: twenty seconds on an idle machine; only what hangs takes
// longer than this on a busy one.
constexpr double kPatienceS = 900;

// Runs a command to its end; fails the test if it takes longer than timeout_s or leaves a process behind.
CommandResult RunCommand(const std::vector<std::string>& argv, double timeout_s = 60);

// The process of a run with this program (its arguments may follow, each after a NUL); -1 if there is none.
pid_t FindProcess(const RunningCommand& run, const std::string& program);
// Fails the test if the program is not there, or not started again within 10 s of its SIGKILL.
void KillAndAwaitReturn(const RunningCommand& run, const std::string& program);

// Waits until the condition holds, at most timeout_s.
template <typename Condition>
bool WaitUntil(Condition condition, double timeout_s);

// An empty folder of its own for each test, removed at its end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& Path() const { return path_; }

 private:
  std::string path_;
};

std::string ReadText(const std::string& path);
void SleepSeconds(double seconds);

template <typename Condition>
bool WaitUntil(Condition condition, double timeout_s) {
  for (double waited = 0; waited < timeout_s; waited += 0.02) {
    if (condition()) return true;
    SleepSeconds(0.02);
  }
  return condition();
}

}  // namespace mapmend

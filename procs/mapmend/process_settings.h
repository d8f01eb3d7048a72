#pragma once

#include <map>
#include <string>
#include <vector>

#include "procs/mapmend/supervisor.h"
#include "procs/mapmend/watchdog.h"

namespace CLI {
class App;
}  // namespace CLI

namespace mapmend {

// The launcher's own options.
struct LauncherOptions {
  WatchdogOptions watchdog;
  SupervisorOptions supervisor;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("watchdog", watchdog);
    v("supervisor", supervisor);
  }
};

// What --config and --set of a command say about the options of the processes that it starts (libs/base/options.h).
// Names begin with the process: "frontend.tracker.min_inliers". The processes themselves know their options; they are
// asked once, so that a mistake is told before anything is started, and so that a process that is started again gets
// the same options though a file has changed meanwhile.
class ProcessSettings {
 public:
  // Adds the two flags to a command that starts these processes. The object must outlive the command.
  void AddFlags(CLI::App* sub, const std::vector<std::string>& processes);

  // As --set NAME=VALUE does. Before Resolve.
  void Set(const std::string& setting) { given_.push_back({false, setting}); }

  // Asks the processes. Throws UsageError with the first mistake in one line. Call once, before anything is started.
  void Resolve();

  // For the command line of a process: "--set", "tracker.min_inliers=30", ... of all that differs from the defaults.
  std::vector<std::string> Arguments(const std::string& process) const;
  // The same as JSON; empty if nothing differs.
  std::string Changes(const std::string& process) const;
  const LauncherOptions& launcher() const { return launcher_; }

 private:
  struct Given {
    bool is_file;
    std::string text;  // path, or NAME=VALUE
  };
  void CheckFile(const std::string& path);
  void CheckSetting(const std::string& setting);
  void Ask(const std::string& process);

  std::vector<std::string> processes_, concerned_;
  std::vector<Given> given_;
  std::map<std::string, std::string> changes_;  // by process, JSON
  LauncherOptions launcher_;
};

// Runs one of mapmend's programs and returns what it prints. Throws UsageError with its line if it ends with
// kExitUsage, and std::runtime_error if it cannot be started or fails otherwise.
std::string AskProgram(const std::string& program, const std::vector<std::string>& arguments);

}  // namespace mapmend

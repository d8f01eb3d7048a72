#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/health_monitor.h"
#include "procs/mapmend/stderr_redirection.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

struct StatusOptions {
  std::string run, lcm_url, channel_prefix;
  bool once = false;
};

// The bus of a run, from the file that the launcher leaves in its folder.
std::string UrlOfRun(const std::string& folder) {
  const std::string path = folder + "/logs/lcm-url";
  std::ifstream file(path);
  std::string url;
  if (!(file >> url))
    throw std::runtime_error("cannot read " + path + ": is " + folder + " the folder of a run (its --out)?");
  return url;
}

std::string FormatCounters(const HealthMonitor::Entry& entry) {
  std::string text = entry.message;
  for (const auto& [name, value] : entry.counters) {
    char number[64];
    std::snprintf(number, sizeof(number), value == std::floor(value) ? "%.0f" : "%.1f", value);
    text += (text.empty() ? "" : " ") + name + "=" + number;
  }
  return text;
}

void PrintTable(const HealthMonitor& monitor, const std::string& url) {
  std::printf("%-14s %7s %-9s %6s %8s %7s %6s  %s\n", "process", "pid", "state", "queue", "CPU s", "MB", "age s",
              "figures");
  if (monitor.Entries().empty()) std::printf("nothing is heard on %s\n", url.c_str());
  for (const auto& [key, entry] : monitor.Entries()) {
    const double age = std::chrono::duration<double>(Clock::now() - entry.received).count();
    const bool silent = age > 5;
    std::printf("%-14s %7d %-9s %6d %8.1f %7.0f %6.1f  %s\n", entry.process.c_str(), entry.pid,
                silent ? "silent" : entry.state.c_str(), entry.queue_depth, entry.cpu_s, entry.rss_mb, age,
                FormatCounters(entry).c_str());
  }
  std::fflush(stdout);
}

void ShowStatus(const StatusOptions& options) {
  InstallSignalHandlers();
  const std::string url = options.run.empty() ? ResolveLcmUrl(options.lcm_url) : UrlOfRun(options.run);
  const StderrRedirection quiet("/dev/null");
  Bus bus(url, options.channel_prefix);
  HealthMonitor monitor(&bus);
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  // Health comes once a second: a little more is waited before the first table.
  for (double wait_s = 1.3; !StopRequested(); wait_s = 1.0) {
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait_s));
    while (Clock::now() < end && !StopRequested()) bus.Handle(50);
    if (terminal && !options.once) std::printf("\033[H\033[2J");
    PrintTable(monitor, url);
    if (!options.once) continue;
    if (monitor.Entries().empty()) throw CLI::RuntimeError(1);
    return;
  }
}

}  // namespace

void AddStatusCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("status", "Show the health of every process, once a second");
  const auto options = std::make_shared<StatusOptions>();
  sub->add_option("RUN", options->run, "folder of a run that goes on (its --out), to find its bus")
      ->excludes(sub->add_option("--lcm-url", options->lcm_url,
                                 "LCM network (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700)"));
  sub->add_option("--channel-prefix", options->channel_prefix, "of the run");
  sub->add_flag("--once", options->once, "print one table and end; exit code 1 if nothing is heard");
  sub->callback([options] { ShowStatus(*options); });
}

}  // namespace mapmend

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/health_monitor.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_state.h"
#include "procs/mapmend/stderr_redirection.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

struct StatusOptions {
  std::string run, lcm_url, channel_prefix;
  bool once = false, json = false;
};

std::string FormatCounters(const HealthMonitor::Entry& entry) {
  std::string text = entry.message;
  for (const auto& [name, value] : entry.counters) {
    char number[64];
    std::snprintf(number, sizeof(number), value == std::floor(value) ? "%.0f" : "%.1f", value);
    text += (text.empty() ? "" : " ") + name + "=" + number;
  }
  return text;
}

bool IsSilent(const HealthMonitor::Entry& entry, double age_s) { return entry.state != "done" && age_s > 5; }

double Age(const HealthMonitor::Entry& entry) {
  return std::chrono::duration<double>(Clock::now() - entry.received).count();
}

// Whether it matters on which host a process is.
bool IsOnSeveralHosts(const HealthMonitor& monitor) {
  const auto& entries = monitor.Entries();
  return std::any_of(entries.begin(), entries.end(),
                     [&](const auto& entry) { return entry.second.host != entries.begin()->second.host; });
}

// The figures, which may be many, are cut to the width of a terminal.
void PrintTable(const HealthMonitor& monitor, const std::string& url, bool with_head, int columns) {
  char text[200];
  std::snprintf(text, sizeof(text), "%-14s %7s %-9s %6s %8s %7s %6s  ", "process", "pid", "state", "queue", "CPU s",
                "MB", "age s");
  if (with_head) std::printf("%sfigures\n", text);
  const bool several_hosts = IsOnSeveralHosts(monitor);
  if (monitor.Entries().empty()) std::printf("nothing is heard on %s\n", url.c_str());
  for (const auto& [key, entry] : monitor.Entries()) {
    const double age = Age(entry);
    std::snprintf(text, sizeof(text), "%-14s %7d %-9s %6d %8.1f %7.0f %6.1f  ", entry.process.c_str(), entry.pid,
                  IsSilent(entry, age) ? "silent" : entry.state.c_str(), entry.queue_depth, entry.cpu_s, entry.rss_mb,
                  age);
    const std::string host = several_hosts ? "on " + entry.host + "  " : "";
    std::printf("%s\n", FitToWidth(text + host + FormatCounters(entry), columns).c_str());
  }
  std::fflush(stdout);
}

// One object on a line.
void PrintJson(const HealthMonitor& monitor, const std::string& url) {
  nlohmann::ordered_json json = {{"bus", url}, {"processes", nlohmann::ordered_json::array()}};
  for (const auto& [key, entry] : monitor.Entries()) {
    const double age = Age(entry);
    json["processes"].push_back({{"process", entry.process},
                                 {"pid", entry.pid},
                                 {"host", entry.host},
                                 {"state", IsSilent(entry, age) ? "silent" : entry.state},
                                 {"message", entry.message},
                                 {"queue", entry.queue_depth},
                                 {"cpu_s", entry.cpu_s},
                                 {"rss_mb", entry.rss_mb},
                                 {"age_s", age},
                                 {"counters", entry.counters}});
  }
  std::printf("%s\n", json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
  std::fflush(stdout);
}

// Says how the run has ended; true if it has.
bool TellEnd(const StatusOptions& options) {
  if (options.run.empty() || IsRunning(options.run)) return false;
  const std::string end = DescribeEnd(options.run);
  if (options.json) {
    std::printf("%s\n", nlohmann::ordered_json({{"ended", true}, {"text", end}}).dump().c_str());
  } else {
    std::printf("%s\n", end.c_str());
  }
  return true;
}

void ShowStatus(const StatusOptions& options) {
  InstallSignalHandlers();
  if (TellEnd(options)) return;
  const std::string url = options.run.empty() ? ResolveLcmUrl(options.lcm_url) : ReadBusAddress(options.run);
  const StderrRedirection quiet("/dev/null");
  Bus bus(url, options.channel_prefix);
  HealthMonitor monitor(&bus);
  const bool terminal = isatty(STDOUT_FILENO) != 0;
  bool first = true;
  // Health comes once a second: a little more is waited before the first table.
  for (double wait_s = 1.3; !StopRequested(); wait_s = 1.0) {
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait_s));
    while (Clock::now() < end && !StopRequested()) bus.Handle(50);
    if (TellEnd(options)) return;
    if (options.json) {
      PrintJson(monitor, url);
    } else {
      const bool clear = terminal && !options.once;
      if (clear) std::printf("\033[H\033[2J");
      PrintTable(monitor, url, clear || first, terminal ? TerminalColumns() : 0);
    }
    first = false;
    if (!options.once) continue;
    if (monitor.Entries().empty()) throw CLI::RuntimeError(1);
    return;
  }
}

}  // namespace

void AddStatusCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("status", "Show the health of every process, once a second");
  const auto options = std::make_shared<StatusOptions>();
  sub->add_option("RUN", options->run, "folder of a run (its --out): its processes until it ends, then how it ended")
      ->excludes(sub->add_option("--lcm-url", options->lcm_url,
                                 "LCM network (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700)"));
  sub->add_option("--channel-prefix", options->channel_prefix, "of the run");
  sub->add_flag("--once", options->once, "print one table and end; exit code 1 if nothing is heard");
  sub->add_flag("--json", options->json, "a JSON object a line instead of the table");
  sub->callback([options] { ShowStatus(*options); });
}

}  // namespace mapmend

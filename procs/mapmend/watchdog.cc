#include "procs/mapmend/watchdog.h"

#include <unistd.h>

#include <fstream>
#include <iterator>
#include <sstream>

namespace mapmend {

ProcessState ReadProcessState(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const size_t end = text.rfind(')');  // the name before it may hold anything
  if (end == std::string::npos) return {};
  std::istringstream fields(text.substr(end + 1));
  ProcessState result;
  std::string skipped;
  fields >> result.state;
  for (int field = 4; field < 14; ++field) fields >> skipped;
  double user = 0, system = 0;  // fields 14 and 15 of proc(5), in clock ticks
  fields >> user >> system;
  result.cpu_ms = 1e3 * (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  return result;
}

std::string Watchdog::Judge(pid_t pid, Clock::time_point since, bool was_heard, double stalled_s) {
  if (pid <= 0) return {};
  const auto [it, is_new] = seen_.try_emplace(pid);
  Seen& seen = it->second;
  if (is_new || since > seen.since) seen = {since, ReadProcessState(pid).cpu_ms};
  // Between its being killed and its being gone it must not be killed, and told, again.
  if (seen.is_told) return {};
  seen.is_told = stalled_s >= options_.stalled_s;
  if (seen.is_told) return "its work has stood still for " + std::to_string(static_cast<int>(stalled_s)) + " s";
  const auto silent_ms = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - since).count();
  if (silent_ms < options_.silent_ms) return {};
  const ProcessState now = ReadProcessState(pid);
  // One that waits for a disk cannot be killed either; one that is traced has somebody who looks after it.
  if (now.state == 0 || now.state == 'D' || now.state == 't') return {};
  const bool is_stopped = now.state == 'T';
  const bool is_idle =
      now.cpu_ms - seen.cpu_ms < options_.min_cpu_ms && (was_heard || silent_ms >= options_.newborn_ms);
  if (!is_stopped && !is_idle && silent_ms < options_.mute_ms) return {};
  seen.is_told = true;
  return "nothing has been heard of it for " + std::to_string(silent_ms / 1000) + " s";
}

}  // namespace mapmend

#include "libs/bus/health.h"

#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <mapmend/health_t.hpp>
#include <sstream>

#include "libs/bus/channels.h"

namespace mapmend {
namespace {

int64_t NowUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

ProcessUsage ReadProcessUsage() {
  ProcessUsage usage;
  rusage r{};
  getrusage(RUSAGE_SELF, &r);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  usage.cpu_s = seconds(r.ru_utime) + seconds(r.ru_stime);
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    std::istringstream words(line);
    std::string key;
    double kb = 0;
    words >> key >> kb;
    if (key == "VmRSS:") usage.rss_mb = kb / 1024;
    if (key == "VmHWM:") usage.peak_rss_mb = kb / 1024;
  }
  return usage;
}

HealthReporter::HealthReporter(Bus* bus, const std::string& process) : buses_{bus}, process_(process) {}

void HealthReporter::SetState(const std::string& state, const std::string& message) {
  if (state == state_ && message == message_) return;
  state_ = state;
  message_ = message;
  PublishNow();
}

void HealthReporter::SetCounter(const std::string& name, double value) { counters_[name] = value; }

void HealthReporter::SetCursor(const std::string& session, int64_t seq) { cursors_[session] = seq; }

void HealthReporter::SetQueueDepth(int depth) { queue_depth_ = depth; }

void HealthReporter::Tick() {
  if (NowUs() - last_publish_us_ >= 1000000) PublishNow();
}

void HealthReporter::PublishNow() {
  last_publish_us_ = NowUs();
  const ProcessUsage usage = ReadProcessUsage();
  health_t health{};
  health.process = process_;
  health.pid = getpid();
  health.version = MAPMEND_VERSION;
  health.utime = last_publish_us_;
  health.state = state_;
  health.message = message_;
  for (const auto& [session, seq] : cursors_) {
    cursor_t cursor{};
    cursor.session = session;
    cursor.seq = seq;
    health.cursors.push_back(cursor);
  }
  health.num_cursors = static_cast<int32_t>(health.cursors.size());
  health.queue_depth = queue_depth_;
  health.cpu_s = usage.cpu_s;
  health.rss_mb = usage.rss_mb;
  health.peak_rss_mb = usage.peak_rss_mb;
  for (const auto& [name, value] : counters_) {
    counter_t counter{};
    counter.name = name;
    counter.value = value;
    health.counters.push_back(counter);
  }
  health.num_counters = static_cast<int32_t>(health.counters.size());
  for (Bus* bus : buses_) bus->Publish(channels::kHealth, health);
}

}  // namespace mapmend

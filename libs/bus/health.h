#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libs/bus/bus.h"

namespace mapmend {

// Publishes health_t at 1 Hz, and at once when the state changes. Call Tick often.
class HealthReporter {
 public:
  HealthReporter(Bus* bus, const std::string& process);
  // Publishes on this bus as well. It must outlive the reporter.
  void AlsoTo(Bus* bus) { buses_.push_back(bus); }

  // state: starting, ready, busy, done, error
  void SetState(const std::string& state, const std::string& message = "");
  void SetCounter(const std::string& name, double value);
  void SetCursor(const std::string& session, int64_t seq);
  void SetQueueDepth(int depth);
  void Tick();

 private:
  void PublishNow();
  std::vector<Bus*> buses_;
  std::string process_, state_ = "starting", message_;
  std::map<std::string, double> counters_;
  std::map<std::string, int64_t> cursors_;
  int queue_depth_ = 0;
  int64_t last_publish_us_ = 0;
};

// CPU seconds used so far and resident memory of this process, from /proc.
struct ProcessUsage {
  double cpu_s = 0, rss_mb = 0, peak_rss_mb = 0;
};
ProcessUsage ReadProcessUsage();

}  // namespace mapmend

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "libs/bus/bus.h"
#include "libs/bus/health.h"

namespace mapmend {

// The last word of every process on MAPMEND_HEALTH.
class HealthMonitor {
 public:
  struct Entry : Health {  // counters and cursors: the last value of each that was ever told
    std::chrono::steady_clock::time_point received;
  };

  explicit HealthMonitor(Bus* bus);  // subscribes; entries change inside the bus's Handle

  // By process name, host, then pid: several of one name may be on a shared bus.
  using Key = std::tuple<std::string, std::string, int>;
  const std::map<Key, Entry>& Entries() const { return entries_; }
  // The entry of one process of this host; nullptr if it has not been heard of.
  const Entry* Find(const std::string& process, int pid) const;
  // The last entry of that name whoever sent it; nullptr if there is none.
  const Entry* FindLatest(const std::string& process) const;
  void Forget(const std::string& process, int pid) { entries_.erase({process, host_, pid}); }

 private:
  const std::string host_ = HostName();
  std::map<Key, Entry> entries_;
  Subscription subscription_;
};

// A counter's value; nothing if the entry is null or does not have it.
std::optional<double> FindCounter(const HealthMonitor::Entry* entry, const std::string& name);
// A counter's value, or fallback if the entry is null or does not have it.
double CounterOr(const HealthMonitor::Entry* entry, const std::string& name, double fallback);

}  // namespace mapmend

#include "procs/mapmend/health_monitor.h"

#include "libs/bus/channels.h"
#include "mapmend/health_t.hpp"

namespace mapmend {

HealthMonitor::HealthMonitor(Bus* bus) {
  subscription_ = bus->Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll, [this](const health_t& health) {
    Entry& entry = entries_[{health.process, health.pid}];
    entry.process = health.process;
    entry.pid = health.pid;
    entry.version = health.version;
    entry.state = health.state;
    entry.message = health.message;
    entry.queue_depth = health.queue_depth;
    entry.cpu_s = health.cpu_s;
    entry.rss_mb = health.rss_mb;
    entry.peak_rss_mb = health.peak_rss_mb;
    for (const counter_t& counter : health.counters) entry.counters[counter.name] = counter.value;
    for (const cursor_t& cursor : health.cursors) entry.cursors[cursor.session] = cursor.seq;
    entry.received = std::chrono::steady_clock::now();
  });
}

const HealthMonitor::Entry* HealthMonitor::Find(const std::string& process, int pid) const {
  const auto found = entries_.find({process, pid});
  return found == entries_.end() ? nullptr : &found->second;
}

const HealthMonitor::Entry* HealthMonitor::FindLatest(const std::string& process) const {
  const Entry* latest = nullptr;
  for (const auto& [key, entry] : entries_) {
    if (key.first == process && (latest == nullptr || entry.received > latest->received)) latest = &entry;
  }
  return latest;
}

std::optional<double> FindCounter(const HealthMonitor::Entry* entry, const std::string& name) {
  if (entry == nullptr) return std::nullopt;
  const auto found = entry->counters.find(name);
  if (found == entry->counters.end()) return std::nullopt;
  return found->second;
}

double CounterOr(const HealthMonitor::Entry* entry, const std::string& name, double fallback) {
  return FindCounter(entry, name).value_or(fallback);
}

}  // namespace mapmend

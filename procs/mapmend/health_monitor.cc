#include "procs/mapmend/health_monitor.h"

#include <utility>

#include "libs/bus/channels.h"

namespace mapmend {

HealthMonitor::HealthMonitor(Bus* bus) {
  subscription_ = bus->Subscribe<Health>(channels::kHealth, Delivery::kKeepAll, [this](const Health& health) {
    Entry& entry = entries_[{health.process, health.host, health.pid}];
    const Entry before = std::move(entry);
    entry = {health, std::chrono::steady_clock::now()};
    entry.counters.insert(before.counters.begin(), before.counters.end());
    entry.cursors.insert(before.cursors.begin(), before.cursors.end());
  });
}

const HealthMonitor::Entry* HealthMonitor::Find(const std::string& process, int pid) const {
  const auto found = entries_.find({process, host_, pid});
  return found == entries_.end() ? nullptr : &found->second;
}

const HealthMonitor::Entry* HealthMonitor::FindLatest(const std::string& process) const {
  const Entry* latest = nullptr;
  for (const auto& [key, entry] : entries_) {
    if (entry.process == process && (latest == nullptr || entry.received > latest->received)) latest = &entry;
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

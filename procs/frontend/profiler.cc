#include "procs/frontend/profiler.h"

#include <algorithm>
#include <numeric>

namespace mapmend {

Profiler& Profiler::Global() {
  static Profiler profiler;
  return profiler;
}

void Profiler::Add(const char* stage, double ms) {
  const std::lock_guard lock(mutex_);
  samples_[stage].push_back(ms);
}

std::vector<Profiler::Row> Profiler::Table() const {
  const std::lock_guard lock(mutex_);
  std::vector<Row> rows;
  for (const auto& [stage, samples] : samples_) {
    std::vector<double> sorted = samples;
    std::sort(sorted.begin(), sorted.end());
    rows.push_back({stage, static_cast<int>(sorted.size()), sorted[sorted.size() / 2],
                    sorted[(sorted.size() * 95 + 99) / 100 - 1],
                    std::accumulate(sorted.begin(), sorted.end(), 0.0) * 1e-3});
  }
  return rows;
}

}  // namespace mapmend

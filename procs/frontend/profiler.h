#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace mapmend {

// Time of each stage per frame in which it ran. One per process, because stages are deep inside classes that should not
// carry it around; it never influences a result. Off until Enable: then a timer costs one clock read.
class Profiler {
 public:
  struct Row {
    std::string stage;
    int frames = 0;
    double median_ms = 0, p95_ms = 0, total_s = 0;
  };

  static Profiler& Global();
  void Enable() { enabled_ = true; }
  bool Enabled() const { return enabled_; }
  void Add(const char* stage, double ms);
  // In the order of their names, which begin with the thread's: capture/..., track/..., map/...
  std::vector<Row> Table() const;

 private:
  bool enabled_ = false;
  mutable std::mutex mutex_;
  std::map<std::string, std::vector<double>> samples_;
};

// Adds the time until the end of its scope. Null: measures nothing.
class StageTimer {
 public:
  explicit StageTimer(const char* stage) : stage_(Profiler::Global().Enabled() ? stage : nullptr) {
    if (stage_ != nullptr) begin_ = std::chrono::steady_clock::now();
  }
  ~StageTimer() {
    if (stage_ == nullptr) return;
    Profiler::Global().Add(
        stage_, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin_).count());
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const char* stage_;
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace mapmend

#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "libs/bus/bus.h"

namespace mapmend {

// What a process says of itself on MAPMEND_HEALTH.
struct Health {
  std::string process;  // frontend, submap_store, merger, viewer_export, mosaic, hub
  int pid = -1;
  std::string host;  // its name, as the system says
  std::string version;
  int64_t utime = 0;                       // wall clock; no decision depends on it
  std::string state;                       // starting, ready, busy, done, error
  std::string message;                     // one line for a person; the error if state is error
  std::map<std::string, int64_t> cursors;  // by session: how far it has been read or written
  int queue_depth = 0;
  double cpu_s = 0, rss_mb = 0, peak_rss_mb = 0;
  std::map<std::string, double> counters;  // e.g. frames, fps, submaps, connections, gaps, bad_messages
  bool operator==(const Health&) const = default;
};
template <>
std::vector<uint8_t> Encode(const Health& health);
template <>
Decoded<Health> Decode(const uint8_t* data, int size);

// Publishes Health at 1 Hz from a thread of its own, however busy its owner is, and at once when the state changes. A
// process that is silent has been stopped or is starved; one that runs but whose work stands still is told by the
// counter stalled_s: seconds since its owner last gave a sign of life. Thread-safe. The bus must outlive it.
class HealthReporter {
 public:
  HealthReporter(Bus* bus, const std::string& process);
  ~HealthReporter();
  HealthReporter(const HealthReporter&) = delete;
  HealthReporter& operator=(const HealthReporter&) = delete;
  // Publishes on this bus as well. It must outlive the reporter.
  void AlsoTo(Bus* bus);

  // state: starting, ready, busy, done, error
  void SetState(const std::string& state, const std::string& message = "");
  void SetCounter(const std::string& name, double value);
  void SetCursor(const std::string& session, int64_t seq);
  void SetQueueDepth(int depth);
  // A sign of life: call in every loop, and now and then in long work.
  void Tick();

 private:
  using Clock = std::chrono::steady_clock;
  void Run();
  Health MakeHealth() const;  // with the lock held

  const std::string process_, host_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::vector<Bus*> buses_;
  struct Content {
    std::string state = "starting", message;
    std::map<std::string, double> counters;
    std::map<std::string, int64_t> cursors;
    int queue_depth = 0;
  };
  // What the owner has set, and what of it is told: as of its last sign of life, when all of it fitted together (a
  // state and the cursors that it is true for).
  Content current_, told_;
  Clock::time_point last_sign_of_life_;
  bool stop_ = false;
  std::thread thread_;
};

// The name of this host.
std::string HostName();

// CPU seconds used so far and resident memory of this process, from /proc.
struct ProcessUsage {
  double cpu_s = 0, rss_mb = 0, peak_rss_mb = 0;
};
ProcessUsage ReadProcessUsage();

}  // namespace mapmend

#include "libs/bus/health.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <mapmend/health_t.hpp>
#include <sstream>

#include "libs/bus/channels.h"

namespace mapmend {

template <>
std::vector<uint8_t> Encode(const Health& health) {
  health_t message{};
  message.process = health.process;
  message.pid = health.pid;
  message.host = health.host;
  message.version = health.version;
  message.utime = health.utime;
  message.state = health.state;
  message.message = health.message;
  for (const auto& [session, seq] : health.cursors) {
    message.cursors.emplace_back();
    message.cursors.back().session = session;
    message.cursors.back().seq = seq;
  }
  message.num_cursors = static_cast<int32_t>(message.cursors.size());
  message.queue_depth = health.queue_depth;
  message.cpu_s = health.cpu_s;
  message.rss_mb = health.rss_mb;
  message.peak_rss_mb = health.peak_rss_mb;
  for (const auto& [name, value] : health.counters) {
    message.counters.emplace_back();
    message.counters.back().name = name;
    message.counters.back().value = value;
  }
  message.num_counters = static_cast<int32_t>(message.counters.size());
  return EncodeMessage(message);
}

template <>
Decoded<Health> Decode(const uint8_t* data, int size) {
  Decoded<health_t> message = Decode<health_t>(data, size);
  if (!message.value) return {std::nullopt, message.error};
  const health_t& m = *message.value;
  Health health{m.process, m.pid,         m.host,  m.version, m.utime,       m.state, m.message,
                {},        m.queue_depth, m.cpu_s, m.rss_mb,  m.peak_rss_mb, {}};
  for (const cursor_t& cursor : m.cursors) health.cursors[cursor.session] = cursor.seq;
  for (const counter_t& counter : m.counters) health.counters[counter.name] = counter.value;
  return {std::move(health), ""};
}

std::string HostName() {
  char name[256] = "";
  gethostname(name, sizeof(name) - 1);
  return name;
}

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

HealthReporter::HealthReporter(Bus* bus, const std::string& process)
    : process_(process), host_(HostName()), buses_{bus}, last_sign_of_life_(Clock::now()) {
  // Signals are for the owner's thread.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::thread([this] { Run(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

HealthReporter::~HealthReporter() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void HealthReporter::AlsoTo(Bus* bus) {
  const std::lock_guard lock(mutex_);
  buses_.push_back(bus);
}

void HealthReporter::Run() {
  constexpr auto kInterval = std::chrono::seconds(1);
  std::unique_lock lock(mutex_);
  while (!changed_.wait_for(lock, kInterval, [this] { return stop_; })) {
    const Health health = MakeHealth();
    const std::vector<Bus*> buses = buses_;
    lock.unlock();
    for (Bus* bus : buses) bus->Publish(channels::kHealth, health);
    lock.lock();
  }
}

void HealthReporter::SetState(const std::string& state, const std::string& message) {
  std::unique_lock lock(mutex_);
  last_sign_of_life_ = Clock::now();
  if (state == current_.state && message == current_.message) return;
  current_.state = state;
  current_.message = message;
  told_ = current_;
  const Health health = MakeHealth();
  const std::vector<Bus*> buses = buses_;
  lock.unlock();
  for (Bus* bus : buses) bus->Publish(channels::kHealth, health);
}

void HealthReporter::SetCounter(const std::string& name, double value) {
  const std::lock_guard lock(mutex_);
  current_.counters[name] = value;
}

void HealthReporter::SetCursor(const std::string& session, int64_t seq) {
  const std::lock_guard lock(mutex_);
  current_.cursors[session] = seq;
}

void HealthReporter::SetQueueDepth(int depth) {
  const std::lock_guard lock(mutex_);
  current_.queue_depth = depth;
}

void HealthReporter::Tick() {
  const std::lock_guard lock(mutex_);
  last_sign_of_life_ = Clock::now();
  told_ = current_;
}

Health HealthReporter::MakeHealth() const {
  const ProcessUsage usage = ReadProcessUsage();
  Health health;
  health.process = process_;
  health.pid = getpid();
  health.host = host_;
  health.version = MAPMEND_VERSION;
  health.utime =
      std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
          .count();
  health.state = told_.state;
  health.message = told_.message;
  health.cursors = told_.cursors;
  health.queue_depth = told_.queue_depth;
  health.cpu_s = usage.cpu_s;
  health.rss_mb = usage.rss_mb;
  health.peak_rss_mb = usage.peak_rss_mb;
  health.counters = told_.counters;
  const auto stalled = std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - last_sign_of_life_).count();
  if (stalled > 0) health.counters["stalled_s"] = static_cast<double>(stalled);
  return health;
}

}  // namespace mapmend

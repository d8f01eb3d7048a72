#include "libs/base/event_log.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace {

constexpr int64_t kFirstDate = 315532800;  // 1980, seconds: an earlier time is none of a calendar

std::string WallClock() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const std::time_t seconds = std::chrono::floor<std::chrono::seconds>(now).count();
  const auto ms = static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(now).count() % 1000);
  std::tm tm{};
  gmtime_r(&seconds, &tm);
  char date[32], text[40];
  std::strftime(date, sizeof(date), "%Y-%m-%dT%H:%M:%S", &tm);
  std::snprintf(text, sizeof(text), "%s.%03dZ", date, ms);
  return text;
}

}  // namespace

EventLog::EventLog(const std::string& path, const std::string& process) : path_(path), process_(process) {
  if (path.empty()) return;
  fd_ = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd_ < 0) Complain(errno);
}

EventLog::~EventLog() {
  if (fd_ >= 0) close(fd_);
}

void EventLog::Add(const std::string& event, const nlohmann::ordered_json& fields) {
  if (fd_ < 0) return;
  nlohmann::ordered_json json = {{"time", WallClock()}, {"process", process_}, {"event", event}};
  for (const auto& [key, value] : fields.items()) json[key] = value;
  const std::string line = json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  errno = ENOSPC;  // of a write that is cut short
  if (write(fd_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) Complain(errno);
}

void EventLog::Complain(int error) {
  if (!complained_) spdlog::warn("events {}: {}; the flight goes on without them", path_, std::strerror(error));
  complained_ = true;
}

std::string FormatUtime(int64_t utime) {
  char text[40];
  const std::time_t seconds = utime / 1000000;
  std::tm tm{};
  if (seconds >= kFirstDate && gmtime_r(&seconds, &tm) != nullptr) {
    std::strftime(text, sizeof(text), "%H:%M:%S", &tm);
  } else {
    std::snprintf(text, sizeof(text), "%.3f s", static_cast<double>(utime) * 1e-6);
  }
  return text;
}

}  // namespace mapmend

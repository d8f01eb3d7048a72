#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace mapmend {

// A file of events, one JSON object per line: {"time": "2026-04-29T12:14:18.250Z" (wall clock), "process", "event",
// ...}. For people and programs that want to know what happened and when; nothing reads it to decide anything. Several
// processes may add to one file: each line is written at once. A file that cannot be written is told once in the log
// and never ends a flight.
class EventLog {
 public:
  // path empty: nothing is written. What the file holds stays.
  EventLog(const std::string& path, const std::string& process);
  ~EventLog();
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  // fields: further members of the object, in this order.
  void Add(const std::string& event, const nlohmann::ordered_json& fields);

 private:
  void Complain(int error);

  std::string path_, process_;
  int fd_ = -1;
  bool complained_ = false;
};

// "12:14:18" (UTC) of a time that is a date, else seconds, "73.250 s".
std::string FormatUtime(int64_t utime);

}  // namespace mapmend

#pragma once

#include <mutex>

namespace mapmend {

// Keeps from standard error, while it lives, the notice that liblcm writes there for each connection it makes
// ("LCM tcpq: connecting..."): who connects often would fill its log with it. All else that any thread writes meanwhile
// follows at the end.
class ConnectionNoticeFilter {
 public:
  ConnectionNoticeFilter();
  ~ConnectionNoticeFilter();
  ConnectionNoticeFilter(const ConnectionNoticeFilter&) = delete;
  ConnectionNoticeFilter& operator=(const ConnectionNoticeFilter&) = delete;

 private:
  static std::mutex mutex_;  // standard error is one for all threads
  const std::lock_guard<std::mutex> lock_;
  int held_ = -1, saved_ = -1;
};

}  // namespace mapmend

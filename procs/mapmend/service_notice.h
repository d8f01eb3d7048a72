#pragma once

#include <chrono>
#include <string>

namespace mapmend {

// What a service manager (systemd, units of Type=notify) is told: that we are ready, how it goes, and that we are alive
// (WatchdogSec). Does nothing if no manager has started us.
class ServiceNotice {
 public:
  // Once, when others may rely on us.
  void Ready();
  // A sign of life, and one line of what we do. Call often; it tells at most once a second.
  void Alive(const std::string& status);

 private:
  std::chrono::steady_clock::time_point last_;
};

}  // namespace mapmend

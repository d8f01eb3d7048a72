#include "procs/mapmend/service_notice.h"

#include <systemd/sd-daemon.h>

namespace mapmend {

void ServiceNotice::Ready() { sd_notify(0, "READY=1"); }

void ServiceNotice::Alive(const std::string& status) {
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < std::chrono::seconds(1)) return;
  last_ = now;
  sd_notify(0, ("WATCHDOG=1\nSTATUS=" + status).c_str());
}

}  // namespace mapmend

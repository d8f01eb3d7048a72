#pragma once

#include <sys/resource.h>
#include <unistd.h>

namespace mapmend {

// Tracking comes first: on Linux a thread has a priority of its own, and this one's is lowered.
inline void GiveWayToTracking() {
  constexpr int kNicer = 5;
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), getpriority(PRIO_PROCESS, 0) + kNicer);
}

}  // namespace mapmend

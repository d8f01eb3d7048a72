#pragma once

#include <mutex>

namespace mapmend {

// A mutex that nobody can take twice while another waits: who gives it back to take it again at once lets the other go
// first.
class FairMutex {
 public:
  void lock() {
    const std::lock_guard next(next_);
    held_.lock();
  }
  void unlock() { held_.unlock(); }

 private:
  std::mutex next_, held_;  // next_: of the one who waits for held_
};

// Held by whoever uses the working map.
using MapLock = std::unique_lock<FairMutex>;

// Between two steps of a long piece of work. Null: nobody else uses the map.
inline void GiveWay(MapLock* lock) {
  if (lock == nullptr) return;
  lock->unlock();
  lock->lock();
}

}  // namespace mapmend

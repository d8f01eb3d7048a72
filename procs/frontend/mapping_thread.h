#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <thread>

#include "procs/frontend/index.h"
#include "procs/frontend/map_lock.h"

namespace mapmend {

// Brings keyframes into the map, one after the other, in a thread of its own, so that tracking need not wait for local
// bundle adjustment. All that both use is guarded by one lock, which mapping gives back whenever it can do without the
// map.
class MappingThread {
 public:
  // Called in the thread, with the lock held; may give it back meanwhile, must hold it at the end.
  using Job = std::function<void(KeyframeIndex keyframe, MapLock* lock)>;

  explicit MappingThread(Job job);
  // Finishes the keyframe at hand; those that wait are forgotten.
  ~MappingThread();

  FairMutex& Mutex() { return mutex_; }
  // The following need the lock.
  size_t NumUnfinished() const { return keyframes_.size(); }
  // These rethrow what a job threw.
  void Push(KeyframeIndex keyframe);
  // Waits until at most so many keyframes are not finished; gives the lock back meanwhile.
  void WaitUntilLeft(size_t keyframes, MapLock* lock);

 private:
  void Run();

  Job job_;
  FairMutex mutex_;
  std::condition_variable_any changed_;
  std::deque<KeyframeIndex> keyframes_;  // the first is at hand
  std::exception_ptr error_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace mapmend

#include "procs/frontend/mapping_thread.h"

#include <utility>

namespace mapmend {

MappingThread::MappingThread(Job job) : job_(std::move(job)) {
  thread_ = std::thread([this] { Run(); });
}

MappingThread::~MappingThread() {
  {
    const MapLock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void MappingThread::Push(KeyframeIndex keyframe) {
  if (error_) std::rethrow_exception(error_);
  keyframes_.push_back(keyframe);
  changed_.notify_all();
}

void MappingThread::WaitUntilLeft(size_t keyframes, MapLock* lock) {
  changed_.wait(*lock, [&] { return keyframes_.size() <= keyframes || error_; });
  if (error_) std::rethrow_exception(error_);
}

void MappingThread::Run() {
  MapLock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return !keyframes_.empty() || stop_; });
    if (stop_) return;
    try {
      job_(keyframes_.front(), &lock);
    } catch (...) {
      if (!lock.owns_lock()) lock.lock();
      error_ = std::current_exception();
      changed_.notify_all();
      return;
    }
    keyframes_.pop_front();
    changed_.notify_all();
  }
}

}  // namespace mapmend

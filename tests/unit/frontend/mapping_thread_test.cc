#include "procs/frontend/mapping_thread.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace mapmend {
namespace mapping_thread_test {

TEST(FairMutex, WhoeverWaitsComesBeforeTheOneWhoTakesItAgain) {
  FairMutex mutex;
  for (int i = 0; i < 5; ++i) {
    MapLock lock(mutex);
    std::atomic<bool> begun = false, came = false;
    std::thread other([&] {
      begun = true;
      const MapLock others_lock(mutex);
      came = true;
    });
    while (!begun) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until it surely waits
    EXPECT_FALSE(came);
    GiveWay(&lock);
    EXPECT_TRUE(came);
    lock.unlock();
    other.join();
  }
}

TEST(MappingThread, KeyframesAreDoneInOrderAndWaitedFor) {
  std::vector<int> done;
  MappingThread thread([&](KeyframeIndex keyframe, MapLock* lock) {
    lock->unlock();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    lock->lock();
    done.push_back(keyframe);
  });
  MapLock lock(thread.Mutex());
  for (int k = 0; k < 10; ++k) {
    thread.Push(KeyframeIndex(k));
    thread.WaitUntilLeft(3, &lock);
    EXPECT_GE(static_cast<int>(done.size()), k + 1 - 3);
  }
  thread.WaitUntilLeft(0, &lock);
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(MappingThread, AnErrorReachesWhoeverWaitsOrPushes) {
  for (const bool unlocked : {false, true}) {
    MappingThread thread([&](KeyframeIndex, MapLock* lock) {
      if (unlocked) lock->unlock();
      throw std::runtime_error("no");
    });
    MapLock lock(thread.Mutex());
    thread.Push(KeyframeIndex(0));
    EXPECT_THROW(thread.WaitUntilLeft(0, &lock), std::runtime_error);
    EXPECT_TRUE(lock.owns_lock());
    EXPECT_THROW(thread.Push(KeyframeIndex(1)), std::runtime_error);
  }
}

TEST(MappingThread, EndsWhileKeyframesWait) {
  std::atomic<int> begun = 0;
  {
    MappingThread thread([&](KeyframeIndex, MapLock*) {
      ++begun;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    });
    const MapLock lock(thread.Mutex());
    for (int k = 0; k < 100; ++k) thread.Push(KeyframeIndex(k));
  }
  EXPECT_LT(begun, 100);
}

}  // namespace mapping_thread_test
}  // namespace mapmend

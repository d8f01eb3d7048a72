#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>

#include "libs/capture/latest_queue.h"
#include "libs/capture/paced_images.h"

namespace mapmend {
namespace realtime_test {

using Clock = std::chrono::steady_clock;

// count images, interval_us apart; throws instead of image `broken`.
class CountingStream : public ImageStream {
 public:
  CountingStream(int count, int64_t interval_us, int broken = -1)
      : count_(count), interval_us_(interval_us), broken_(broken) {}
  std::optional<SourceImage> Next() override {
    if (next_ == broken_) throw std::runtime_error("broken");
    if (next_ == count_) return std::nullopt;
    const int index = next_++;
    return SourceImage{index, 1000000 + index * interval_us_, nullptr};
  }

 private:
  int count_, next_ = 0;
  int64_t interval_us_;
  int broken_;
};

TEST(LatestQueue, KeepsTheNewestAndCountsTheRest) {
  LatestQueue<int> queue(2);
  for (int i = 0; i < 5; ++i) queue.Push(i);
  queue.Close();
  queue.Push(9);
  EXPECT_EQ(queue.Pop(), 3);
  EXPECT_EQ(queue.Pop(), 4);
  EXPECT_EQ(queue.Pop(), std::nullopt);
  EXPECT_EQ(queue.NumDropped(), 3);
}

TEST(PacedImages, AQuickReaderGetsEveryImageWhenItsTimeHasCome) {
  CountingStream source(5, 100000);
  const auto begin = Clock::now();
  PacedImages images(&source, 2.0, 1);
  for (int i = 0; i < 5; ++i) {
    const auto image = images.Next();
    ASSERT_TRUE(image);
    EXPECT_EQ(image->index, i);
    EXPECT_GE(Clock::now() - begin, std::chrono::milliseconds(50 * i));
  }
  EXPECT_FALSE(images.Next());
  EXPECT_EQ(images.NumDropped(), 0);
}

TEST(PacedImages, ASlowReaderGetsTheNewestAndNoneIsUnaccountedFor) {
  CountingStream source(50, 1000);
  PacedImages images(&source, 1.0, 2);
  ASSERT_TRUE(images.Next());
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  int taken = 1, last = 0;
  while (const auto image = images.Next()) {
    ++taken;
    last = image->index;
  }
  EXPECT_EQ(last, 49);
  EXPECT_GT(images.NumDropped(), 0);
  EXPECT_EQ(taken + images.NumDropped(), 50);
}

TEST(PacedImages, StopEndsAWaitAndErrorsComeThrough) {
  CountingStream slow(2, 3600LL * 1000000);
  PacedImages images(&slow, 1.0, 1);
  ASSERT_TRUE(images.Next());
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    images.Stop();
  });
  EXPECT_FALSE(images.Next());
  stopper.join();

  CountingStream broken(3, 1, 1);
  PacedImages failing(&broken, 1.0, 3);
  EXPECT_TRUE(failing.Next());
  EXPECT_THROW(failing.Next(), std::runtime_error);
}

}  // namespace realtime_test
}  // namespace mapmend

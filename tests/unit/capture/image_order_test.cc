#include "libs/capture/image_order.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace mapmend {
namespace image_order_test {

constexpr int64_t kHour = 3600LL * 1000000, kStep = 33333;

// A camera beside the order that takes its images, one each 33 ms.
class ImageOrderTest : public testing::Test {
 protected:
  void Send(int64_t utime, int frame) {
    arrival_ += kStep;
    const ImageOrder::Decision decision = order_.Add(utime, frame, arrival_);
    for (const auto& good : decision.good) {
      EXPECT_GT(good.utime, utimes_.empty() ? 0 : utimes_.back());
      EXPECT_GT(good.index, indices_.empty() ? -1 : indices_.back());
      utimes_.push_back(good.utime);
      indices_.push_back(good.index);
      ids_.push_back(good.id);
    }
    num_strays_ += static_cast<int>(decision.strays.size());
    if (!decision.event.empty()) events_.push_back(decision.event);
  }
  void SendMany(int count) {
    for (int i = 0; i < count; ++i, ++frame_) Send(clock_ += kStep, frame_);
  }

  ImageOrder order_;
  int64_t arrival_ = 77, clock_ = 1700000000000000;
  int frame_ = 0, num_strays_ = 0;
  std::vector<int64_t> utimes_, ids_;
  std::vector<int> indices_;
  std::vector<std::string> events_;
};

TEST_F(ImageOrderTest, WhatGrowsIsTakenAsItIs) {
  SendMany(100);
  EXPECT_EQ(utimes_.size(), 100u);
  EXPECT_EQ(utimes_.back(), clock_);
  EXPECT_EQ(indices_.back(), 99);
  EXPECT_TRUE(events_.empty());
}

TEST_F(ImageOrderTest, OneImageOfAnotherTimeIsRefusedAndTheFlightGoesOn) {
  for (const int64_t off : {kHour, -kHour, 24 * kHour, -clock_ + 1}) {
    SendMany(50);
    Send(clock_ + off, frame_);
    SendMany(50);
  }
  EXPECT_EQ(num_strays_, 4);
  EXPECT_EQ(utimes_.size(), 400u);
  EXPECT_EQ(utimes_.back(), clock_);
}

TEST_F(ImageOrderTest, AClockThatIsSetBackLosesNothing) {
  SendMany(50);
  const int64_t before = utimes_.back();
  clock_ -= kHour;
  SendMany(50);
  EXPECT_EQ(utimes_.size(), 100u);
  EXPECT_EQ(num_strays_, 0);
  EXPECT_EQ(utimes_.back(), before + 50 * kStep);
  ASSERT_EQ(events_.size(), 1u);
  EXPECT_NE(events_[0].find("went back by 3599.9 s"), std::string::npos) << events_[0];
  clock_ += kHour;  // and put right
  SendMany(50);
  EXPECT_EQ(utimes_.size(), 150u);
  EXPECT_EQ(utimes_.back(), clock_);
}

TEST_F(ImageOrderTest, AClockThatIsSetForwardLosesNothing) {
  SendMany(50);
  clock_ += kHour;
  SendMany(50);
  EXPECT_EQ(utimes_.size(), 100u);
  EXPECT_EQ(utimes_.back(), clock_);
  EXPECT_EQ(events_.size(), 1u);
}

TEST_F(ImageOrderTest, AFirstImageOfAWrongTimeDoesNotDecide) {
  Send(clock_ + kHour, 0);
  SendMany(50);
  EXPECT_EQ(utimes_.size(), 51u);
  EXPECT_EQ(num_strays_, 0);
}

TEST_F(ImageOrderTest, ACameraThatIsStartedAgainOrWasAwayGoesOn) {
  SendMany(50);
  frame_ = 0;
  SendMany(50);
  arrival_ += 60000000;
  clock_ += 60000000;
  SendMany(50);
  EXPECT_EQ(utimes_.size(), 150u);
  EXPECT_EQ(num_strays_, 0);
  EXPECT_EQ(indices_.back(), 149);
  EXPECT_TRUE(events_.empty()) << events_[0];
}

TEST_F(ImageOrderTest, OfTwoCamerasOnOneChannelTheFirstIsTakenAndTheOtherTold) {
  SendMany(5);
  for (const int64_t other_clock : {5000 * kHour, int64_t(1000)}) {
    const size_t before = utimes_.size();
    for (int i = 0; i < 100; ++i) {
      SendMany(1);
      Send(other_clock + i * kStep, 1000 + i);
    }
    EXPECT_EQ(utimes_.size(), before + 100);
    EXPECT_FALSE(events_.empty());
    EXPECT_NE(events_[0].find("another camera"), std::string::npos) << events_[0];
  }
  EXPECT_EQ(utimes_.back(), clock_);
}

TEST_F(ImageOrderTest, TwoCamerasWithOneClockAreToldApartByTheirNumbers) {
  frame_ = 500;
  SendMany(5);
  for (int i = 0; i < 100; ++i) {
    Send(clock_ + kStep / 2, 20 + i);
    SendMany(1);
  }
  EXPECT_EQ(utimes_.size(), 105u);
  EXPECT_EQ(indices_.back(), 604);
  ASSERT_FALSE(events_.empty());
  EXPECT_NE(events_[0].find("another camera"), std::string::npos) << events_[0];
}

TEST_F(ImageOrderTest, CamerasThatDoNotCountAreCounted) {
  for (int i = 0; i < 20; ++i) Send(clock_ += kStep, 0);
  EXPECT_EQ(utimes_.size(), 20u);
  EXPECT_EQ(indices_.back(), 19);
}

TEST_F(ImageOrderTest, ARecordingThatIsPlayedFastIsInOrder) {
  for (int i = 0; i < 50; ++i) Send(clock_ += 20 * kStep, i);
  EXPECT_EQ(utimes_.size(), 50u);
}

}  // namespace image_order_test
}  // namespace mapmend

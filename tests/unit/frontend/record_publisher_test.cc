#include "procs/frontend/record_publisher.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace record_publisher_test {

FramePtr FrameAt(int index) {
  auto frame = std::make_shared<Frame>();
  frame->index = index;
  frame->utime = 1000000 * int64_t{index};
  frame->features.keypoints.resize(1);
  frame->features.descriptors.resize(1);
  frame->features.colors.resize(1);
  return frame;
}

TrackResult TrackedAt(KeyframeIndex reference) {
  TrackResult tracked;
  tracked.reference_keyframe = reference;
  return tracked;
}

// A submap of keyframes 0 and 1 (frames 0 and 2), frame 1 refers to the first.
class RecordPublisherTest : public testing::Test {
 protected:
  RecordPublisherTest() {
    publisher.Begin();
    AddKeyframe(0);
    publisher.NoteFrame(map, *FrameAt(1), TrackedAt(KeyframeIndex(0)));
    AddKeyframe(2);
  }
  void AddKeyframe(int frame) { publisher.NoteKeyframe(map, map.AddKeyframe(FrameAt(frame), Rigid3())); }
  template <typename T>
  std::vector<T> Emitted() const {
    std::vector<T> found;
    for (const RecordBody& body : emitted) {
      if (const T* record = std::get_if<T>(&body)) found.push_back(*record);
    }
    return found;
  }

  std::vector<RecordBody> emitted;
  RecordPublisher publisher{
      {}, Pinhole(), Pyramid(), nullptr, [this](int64_t, RecordBody body) { emitted.push_back(std::move(body)); }};
  IdSource ids;
  WorkingMap map{SubmapId(0), Pyramid(), &ids};
};

TEST_F(RecordPublisherTest, NothingIsPublishedOfASubmapThatIsNotBelieved) {
  publisher.Publish(2000000, &map);
  EXPECT_TRUE(emitted.empty());
  EXPECT_EQ(publisher.NumTracked(), 3);
  publisher.Forget();
  EXPECT_EQ(publisher.NumTracked(), 0);
}

TEST_F(RecordPublisherTest, OnceItIsBelievedItsBeginningComesFirst) {
  publisher.Believe();
  EXPECT_EQ(publisher.FirstFrame().frame, 0);
  publisher.Publish(2000000, &map);
  ASSERT_EQ(emitted.size(), 4u);
  EXPECT_TRUE(std::holds_alternative<SubmapStarted>(emitted.front()));
  const auto keyframes = Emitted<KeyframeRecord>();
  ASSERT_EQ(keyframes.size(), 2u);
  EXPECT_EQ(keyframes[1].frame, 2);
  EXPECT_EQ(keyframes[1].words, std::vector<int32_t>(1, -1));  // no vocabulary
  ASSERT_EQ(Emitted<MapUpdate>().size(), 1u);
  EXPECT_EQ(Emitted<MapUpdate>()[0].frames.size(), 3u);
  publisher.Publish(2000000, &map);
  EXPECT_EQ(emitted.size(), 4u);  // nothing new
}

TEST_F(RecordPublisherTest, FramesOfAKeyframeThatIsNotMappedYetFollowWithIt) {
  publisher.Believe();
  publisher.EmitAll(publisher.Take(2000000, KeyframeIndex(0), &map));
  ASSERT_EQ(Emitted<MapUpdate>().size(), 1u);
  EXPECT_EQ(Emitted<MapUpdate>()[0].frames.size(), 2u);
  publisher.EmitAll(publisher.Take(2000000, KeyframeIndex(1), &map));
  ASSERT_EQ(Emitted<MapUpdate>().size(), 2u);
  EXPECT_EQ(Emitted<MapUpdate>()[1].frames.size(), 1u);
}

TEST_F(RecordPublisherTest, FramesThatWaitTooLongAreNotKept) {
  publisher.Believe();
  publisher.Publish(2000000, &map);
  emitted.clear();
  const auto hover = [&](int first, int last) {
    for (int i = first; i <= last; ++i) publisher.NoteFrame(map, *FrameAt(i), TrackedAt(KeyframeIndex(1)));
  };
  hover(3, 31);
  publisher.PublishWaitingFrames(31000000, map, false);
  EXPECT_TRUE(emitted.empty());
  hover(32, 32);
  publisher.PublishWaitingFrames(32000000, map, false);
  ASSERT_EQ(Emitted<MapUpdate>().size(), 1u);
  EXPECT_EQ(Emitted<MapUpdate>()[0].frames.size(), 30u);
  hover(33, 33);
  publisher.PublishWaitingFrames(33300000, map, true);
  EXPECT_EQ(Emitted<MapUpdate>().size(), 1u);
  publisher.PublishWaitingFrames(33500000, map, true);
  EXPECT_EQ(Emitted<MapUpdate>().size(), 2u);
}

TEST_F(RecordPublisherTest, TheEndComesLast) {
  publisher.Believe();
  publisher.Publish(2000000, &map);
  publisher.End(*FrameAt(2), LossReason::kBlur, "why", map);
  ASSERT_FALSE(emitted.empty());
  const auto* end = std::get_if<SubmapEnded>(&emitted.back());
  ASSERT_NE(end, nullptr);
  EXPECT_EQ(end->reason, "blur");
  EXPECT_EQ(Emitted<KeyframeRecord>().size(), 2u);
}

}  // namespace record_publisher_test
}  // namespace mapmend

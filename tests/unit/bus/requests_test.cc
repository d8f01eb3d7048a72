#include "libs/bus/requests.h"

#include <gtest/gtest.h>

#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <set>
#include <thread>

#include "libs/bus/channels.h"
#include "tests/running_hub.h"

namespace mapmend {
namespace requests_test {

using Clock = std::chrono::steady_clock;

// A store that notes what it is asked and answers when it is told to.
class FakeStore {
 public:
  explicit FakeStore(const std::string& url) : bus_(url, "") {
    subscription_ = bus_.Subscribe<fetch_t>(channels::kFetch, Delivery::kKeepAll, [this](const fetch_t& request) {
      ids.insert(request.id);
      ++num_heard;
      last_ = request;
    });
  }
  void Hear(int ms = 50) {
    const auto end = Clock::now() + std::chrono::milliseconds(ms);
    while (Clock::now() < end) bus_.Handle(5);
  }
  bool HearUntil(const std::function<bool()>& done) {
    for (int i = 0; i < 1000 && !done(); ++i) Hear(10);
    return done();
  }
  void Answer(const std::string& requester = "") {
    fetched_t reply{};
    reply.id = last_.id;
    reply.requester = requester.empty() ? last_.requester : requester;
    reply.cumulative = last_.first_seq;
    bus_.Publish(channels::kFetched, reply);
  }
  std::set<int64_t> ids;
  int num_heard = 0;

 private:
  Bus bus_;
  fetch_t last_{};
  Subscription subscription_;
};

fetch_t Wanted(int64_t seq) {
  fetch_t request{};
  request.session = "s";
  request.first_seq = seq;
  return request;
}

class RequestsTest : public ::testing::Test {
 protected:
  RequestsTest() { store_.Hear(); }
  RunningHub hub_;
  FakeStore store_{hub_.Url()};
  Bus bus_{hub_.Url(), ""};
  Requests<fetch_t, fetched_t> requests_{&bus_, "me", channels::kFetch, channels::kFetched};
};

TEST_F(RequestsTest, AnAnswerCountsWheneverItComes) {
  EXPECT_FALSE(requests_.Ask(Wanted(7), 50));
  ASSERT_TRUE(store_.HearUntil([&] { return store_.num_heard == 1; }));
  store_.Answer("somebody else");
  EXPECT_FALSE(requests_.Ask(Wanted(7), 50));
  store_.Answer();
  bus_.Handle(2000);  // comes while nobody asks
  const auto reply = requests_.Ask(Wanted(7), 0);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->cumulative, 7);
  store_.Hear();
  EXPECT_EQ(store_.ids.size(), 1u);
  EXPECT_FALSE(requests_.Ask(Wanted(7), 50));  // once answered, the same again is a new request
  ASSERT_TRUE(store_.HearUntil([&] { return store_.ids.size() == 2; }));
}

TEST_F(RequestsTest, OthersDoNotEndWhatWaits) {
  EXPECT_FALSE(requests_.Ask(Wanted(1), 20));
  ASSERT_TRUE(store_.HearUntil([&] { return store_.num_heard == 1; }));
  store_.Answer();
  EXPECT_FALSE(requests_.Ask(Wanted(2), 300));  // meanwhile the first is answered
  const auto reply = requests_.Ask(Wanted(1), 0);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->cumulative, 1);
}

TEST_F(RequestsTest, ASilentStoreIsAskedLessAndLessOften) {
  const auto end = Clock::now() + std::chrono::milliseconds(4000);
  while (Clock::now() < end) EXPECT_FALSE(requests_.Ask(Wanted(1), 100));
  store_.Hear(300);
  EXPECT_EQ(store_.ids.size(), 1u);
  EXPECT_GE(store_.num_heard, 2);
  EXPECT_LE(store_.num_heard, 4);  // at 0, 0.5, 1.5, 3.5 s, give or take a quarter
}

TEST_F(RequestsTest, AsksAtOnceOverANewConnection) {
  EXPECT_FALSE(requests_.Ask(Wanted(1), 1800));
  ASSERT_TRUE(store_.HearUntil([&] { return store_.num_heard >= 2; }));  // the next is due in more than a second
  const int num_before = store_.num_heard;
  hub_.Stop(true);
  while (bus_.IsConnected()) EXPECT_FALSE(requests_.Ask(Wanted(1), 50));
  hub_.Stop(false);
  EXPECT_FALSE(requests_.Ask(Wanted(1), 1000));
  EXPECT_TRUE(store_.HearUntil([&] { return store_.num_heard > num_before; }));
  EXPECT_EQ(store_.ids.size(), 1u);
}

TEST(PeekReply, TellsWhoAReplyIsForAndRefusesGarbage) {
  fetched_t reply{};
  reply.id = 12345678901;
  reply.requester = "viewer-7";
  std::vector<uint8_t> data = EncodeMessage(reply);
  const auto address = PeekReply(data.data(), static_cast<int>(data.size()));
  ASSERT_TRUE(address);
  EXPECT_EQ(address->id, 12345678901);
  EXPECT_EQ(address->requester, "viewer-7");
  EXPECT_FALSE(PeekReply(data.data(), 20));
  data[16] = 0xff;  // the length of requester
  EXPECT_FALSE(PeekReply(data.data(), static_cast<int>(data.size())));
}

}  // namespace requests_test
}  // namespace mapmend

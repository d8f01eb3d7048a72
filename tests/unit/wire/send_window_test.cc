#include "libs/wire/send_window.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace send_window_test {

using std::chrono::milliseconds;

// A window and what it has sent, in time of the test's own.
class SendWindowTest : public ::testing::Test {
 protected:
  void Add(int64_t seq) { window_.Add({"s", seq, "MAPMEND_KEYFRAME", std::vector<uint8_t>(10)}); }
  std::vector<int64_t> Send() {
    std::vector<int64_t> sent;
    window_.SendDue(now_, [&](const EncodedRecord& record) {
      sent.push_back(record.seq);
      return true;
    });
    return sent;
  }
  SendWindow window_{2000};
  SendWindow::Clock::time_point now_ = SendWindow::Clock::time_point(std::chrono::hours(1));
};

using Seqs = std::vector<int64_t>;

TEST_F(SendWindowTest, SendsEachOnceAndThenOnlyTheOldestWhileTheStoreIsSilent) {
  for (const int64_t seq : {0, 1, 2}) Add(seq);
  EXPECT_EQ(Send(), (Seqs{0, 1, 2}));
  now_ += milliseconds(1000);
  EXPECT_EQ(Send(), Seqs{});
  now_ += milliseconds(1500);
  EXPECT_EQ(Send(), Seqs{0});
}

TEST_F(SendWindowTest, DoesNotSendAgainWhatIsOnItsWayOverASlowLink) {
  // Acknowledgements take 600 ms; each names all that are on their way as missing.
  for (int64_t seq = 0; seq < 20; ++seq) {
    Add(seq);
    Send();
    now_ += milliseconds(600);
    window_.Acknowledge(seq, now_);
  }
  for (const int64_t seq : {20, 21, 22}) Add(seq);
  EXPECT_EQ(Send(), (Seqs{20, 21, 22}));
  for (int i = 0; i < 11; ++i) {
    now_ += milliseconds(50);
    window_.OnMissing({20, 21, 22});
    EXPECT_EQ(Send(), Seqs{}) << i;
  }
}

TEST_F(SendWindowTest, SendsAtOnceWhatTheStoreLacksThoughItHasWhatCameLater) {
  for (int64_t seq = 0; seq < 6; ++seq) Add(seq);
  Send();
  now_ += milliseconds(1);
  window_.OnMissing({1, 2, 5});  // 3 and 4 have come, 5 is still on its way
  EXPECT_EQ(Send(), (Seqs{1, 2}));
  now_ += milliseconds(1);
  window_.OnMissing({1, 2, 5});  // they are on their way again
  EXPECT_EQ(Send(), Seqs{});
}

TEST_F(SendWindowTest, SendsTheTailAgainWhenItHasTakenTooLong) {
  for (const int64_t seq : {0, 1}) Add(seq);
  Send();
  now_ += milliseconds(10);
  window_.Acknowledge(0, now_);
  window_.OnMissing({1});
  EXPECT_EQ(Send(), Seqs{});
  now_ += milliseconds(100);
  window_.OnMissing({1});
  EXPECT_EQ(Send(), Seqs{1});
}

TEST_F(SendWindowTest, AfterACutSendsOnceWhatTheStoreLacksHoweverSlowTheNewConnectionIs) {
  for (int64_t seq = 0; seq < 20; ++seq) Add(seq);
  Send();
  now_ += milliseconds(60000);
  window_.OnNewPeer();
  EXPECT_EQ(Send(), Seqs{0});  // nobody has said anything yet
  // The first five had come before the cut. The others take 400 ms each, and the store asks for them twenty times a
  // second meanwhile.
  window_.Acknowledge(4, now_);
  size_t num_sent = 0;
  for (int64_t next = 5; next < 20; ++next) {
    for (int i = 0; i < 8; ++i) {
      Seqs missing;
      for (int64_t seq = next; seq < 20; ++seq) missing.push_back(seq);
      window_.OnMissing(missing);
      num_sent += Send().size();
      now_ += milliseconds(50);
    }
    window_.Acknowledge(next, now_);
  }
  EXPECT_GE(num_sent, 15u);
  EXPECT_LE(num_sent, 35u);  // before the first has come, it is not known how slow it is
}

TEST_F(SendWindowTest, GoesOnWhereTheBusRefused) {
  for (const int64_t seq : {0, 1, 2}) Add(seq);
  int num_taken = 0;
  window_.SendDue(now_, [&](const EncodedRecord&) { return num_taken++ < 1; });
  EXPECT_EQ(Send(), (Seqs{1, 2}));
}

TEST_F(SendWindowTest, ALongOutageSaysNothingOfHowLongTheNewConnectionTakes) {
  Add(0);
  Send();
  window_.OnNewPeer();
  now_ += milliseconds(60000);
  window_.Acknowledge(0, now_);
  Add(1);
  Send();
  now_ += milliseconds(400);
  window_.OnMissing({1});
  EXPECT_EQ(Send(), Seqs{1});
}

}  // namespace send_window_test
}  // namespace mapmend

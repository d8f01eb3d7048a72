#include "procs/submap_store/request_queue.h"

#include <gtest/gtest.h>

#include <vector>

namespace mapmend {
namespace request_queue_test {

class RequestQueueTest : public ::testing::Test {
 protected:
  void Add(const std::string& requester, int64_t id, int64_t now_ms) {
    queue_.Add({"FETCH", requester, id}, now_ms, [this, id] {
      answered_.push_back(id);
      return int64_t{100};
    });
  }
  RequestQueue queue_;
  std::vector<int64_t> answered_;
};

using Ids = std::vector<int64_t>;

TEST_F(RequestQueueTest, AnswersARepeatedRequestOnce) {
  for (int i = 0; i < 5; ++i) Add("viewer", 1, 0);
  Add("merger", 1, 0);
  queue_.Answer(0, 1000);
  EXPECT_EQ(answered_, (Ids{1, 1}));
  EXPECT_EQ(queue_.NumShed(), 4);
  EXPECT_TRUE(queue_.Empty());
}

TEST_F(RequestQueueTest, AnswersAgainOnlySomeTimeAfterTheFirstAnswer) {
  Add("viewer", 1, 0);
  queue_.Answer(300, 1000);  // it had to wait
  Add("viewer", 1, 500);     // and was repeated meanwhile
  queue_.Answer(500, 1000);
  EXPECT_EQ(answered_, Ids{1});
  Add("viewer", 1, 1500);  // the answer was lost
  queue_.Answer(1500, 1000);
  EXPECT_EQ(answered_, (Ids{1, 1}));
}

TEST_F(RequestQueueTest, StopsWhenEnoughHasBeenSent) {
  for (int64_t id = 0; id < 5; ++id) Add("viewer", id, 0);
  queue_.Answer(0, 200);
  EXPECT_EQ(answered_, (Ids{0, 1}));
  queue_.Answer(0, 200);
  EXPECT_EQ(answered_, (Ids{0, 1, 2, 3}));
}

}  // namespace request_queue_test
}  // namespace mapmend

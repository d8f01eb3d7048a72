#include "libs/wire/store_client.h"

#include <gtest/gtest.h>

#include <mapmend/bow_query_t.hpp>
#include <mapmend/bow_result_t.hpp>

#include "tests/fake_store.h"
#include "tests/running_hub.h"

namespace mapmend {
namespace store_client_test {

constexpr char kFlight[] = "00000000-0000-4000-8000-000000000001";
constexpr int kLongMs = 30000;  // on any machine

class StoreClientTest : public ::testing::Test {
 protected:
  RunningHub hub_;
  FakeStore store_{hub_.Url()};
  Bus bus_{hub_.Url(), ""};
  StoreClient client_{&bus_, "test"};
};

TEST_F(StoreClientTest, NoAnswerIsNoAnswer) {
  store_.is_silent = true;
  EXPECT_FALSE(client_.Query({}, 20).has_value());
  EXPECT_FALSE(client_.Fetch({}, 20).has_value());
  EXPECT_FALSE(client_.AskProgress(kFlight, 20).has_value());
  EXPECT_FALSE(client_.CloseSession(kFlight, 20).has_value());
  EXPECT_FALSE(client_.DecideEdges({}, 20).has_value());
}

TEST_F(StoreClientTest, WhoAsksAgainGetsTheAnswer) {
  store_.is_silent = true;
  EXPECT_FALSE(client_.AskProgress(kFlight, 20).has_value());
  store_.is_silent = false;
  EXPECT_TRUE(client_.AskProgress(kFlight, kLongMs).has_value());
  EXPECT_TRUE(client_.Fetch({}, kLongMs).has_value());
  EXPECT_TRUE(client_.DecideEdges({}, kLongMs).has_value());
}

TEST_F(StoreClientTest, ASessionWhoseFrontendIsHeardOfIsAskedForAgain) {
  store_.still_alive = 3;
  EXPECT_TRUE(client_.CloseSession(kFlight, kLongMs).has_value());
  EXPECT_EQ(store_.still_alive, 0);
}

}  // namespace store_client_test
}  // namespace mapmend

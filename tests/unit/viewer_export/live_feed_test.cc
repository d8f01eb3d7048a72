#include "procs/viewer_export/live_feed.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace mapmend {
namespace live_feed_test {

using Json = nlohmann::json;

constexpr size_t kAll = 1 << 30;

Json Changes(const LiveFeed& feed, int64_t version, size_t max_bytes = kAll) {
  const std::string text = feed.Since(version, max_bytes).json;
  return text.empty() ? Json() : Json::parse(text);
}

TEST(LiveFeedTest, TellsOnlyWhatHasChangedSince) {
  LiveFeed feed;
  EXPECT_EQ(feed.Since(0, kAll).json, "");
  feed.Set("run", "{\"a\":1}");
  feed.Set("pose", "2");
  const int64_t seen = feed.Version();
  feed.Set("run", "{\"a\":1}");
  EXPECT_EQ(feed.Version(), seen) << "an equal value is no change";
  feed.Set("pose", "3");
  const Json changes = Changes(feed, seen);
  EXPECT_EQ(changes["set"], Json({{"pose", 3}}));
  EXPECT_EQ(changes["from"], seen);
  EXPECT_EQ(changes["to"], feed.Version());
  EXPECT_EQ(Changes(feed, 0)["set"].size(), 2u);
  EXPECT_EQ(Changes(feed, 99)["set"].size(), 2u) << "of another viewer, it seems";
}

TEST(LiveFeedTest, WhatIsGoneIsToldOnceMore) {
  LiveFeed feed;
  feed.Set("edge/a", "1");
  feed.Set("edge/b", "2");
  feed.Set("run", "3");
  const int64_t seen = feed.Version();
  feed.KeepOnly("edge/", {"edge/b"});
  feed.Erase("nothing");
  EXPECT_EQ(Changes(feed, seen)["gone"], Json({"edge/a"}));
  EXPECT_EQ(feed.Values(), "{\"edge/b\":2,\"run\":3}");
  feed.Set("edge/a", "4");
  EXPECT_EQ(Changes(feed, seen)["gone"], Json::array());
}

TEST(LiveFeedTest, RowsComeInTheirNewestFormAndOnce) {
  LiveFeed feed;
  feed.SetRow("points/0:0", 0, "abcd");
  feed.SetRow("points/0:0", 2, "efgh");
  const int64_t seen = feed.Version();
  feed.SetRow("points/0:0", 2, "ijkl");
  feed.SetRow("points/0:0", 2, "mnop");
  // Row 2, little-endian, and its bytes.
  EXPECT_EQ(Changes(feed, seen)["rows"], Json({{"points/0:0", "AgAAAG1ub3A="}}));
  EXPECT_EQ(Changes(feed, 0)["rows"]["points/0:0"], "AAAAAGFiY2QCAAAAbW5vcA==") << "row 1 was never set";
  EXPECT_THROW(feed.SetRow("points/0:0", 1, "longer"), std::logic_error);
}

TEST(LiveFeedTest, APageThatTakesLittleAtATimeGetsEverythingOnce) {
  LiveFeed feed;
  for (int round = 0; round < 3; ++round) {
    for (uint32_t row = 0; row < 2000; ++row)
      feed.SetRow("t", row, std::to_string(100000 * (round + 1) + static_cast<int>(row)));
  }
  feed.Set("last", "true");
  int64_t version = 0;
  size_t encoded = 0;
  int messages = 0;
  for (bool complete = false; !complete; ++messages) {
    const Json changes = Changes(feed, version, 4000);
    ASSERT_TRUE(changes.is_object());
    ASSERT_GT(changes["to"].get<int64_t>(), version);
    version = changes["to"];
    if (changes["rows"].contains("t")) {
      const size_t size = changes["rows"]["t"].get<std::string>().size();
      EXPECT_LT(size, 4200u);
      encoded += size;
    }
    complete = version == changes["newest"];
    EXPECT_EQ(changes["set"].contains("last"), complete) << "oldest first";
  }
  EXPECT_GT(messages, 5);
  EXPECT_NEAR(static_cast<double>(encoded), 2000 * 10 * 4 / 3.0, 4.0 * messages) << "each row once";
  EXPECT_EQ(feed.Since(version, 4000).json, "");
}

TEST(LiveFeedTest, RunsOfAViewerHaveDifferentEpochs) { EXPECT_NE(LiveFeed().Epoch(), LiveFeed().Epoch()); }

}  // namespace live_feed_test
}  // namespace mapmend

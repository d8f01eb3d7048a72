#include "libs/retrieval/recall.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace recall_test {

TEST(MeasureRecall, CountsQueriesWhosePlaceIsRankedFirstOrLater) {
  const auto frame = [](double x, std::vector<int32_t> words) {
    RecallFrame f;
    f.position = {x, 0, 0};
    f.bow.weights.assign(words.size(), 1.0f / static_cast<float>(words.size()));
    f.bow.words = std::move(words);
    return f;
  };
  // 0 and 3 are one place and alike; 1 and 4 are one place, but 4 looks more like 2; nothing is near 2.
  const std::vector<RecallFrame> frames = {frame(0, {1, 2, 3, 4}), frame(100, {5, 6, 7, 8}),
                                           frame(200, {9, 10, 11, 12}), frame(1, {1, 2, 3, 13}),
                                           frame(101, {5, 9, 10, 11})};
  const RecallResult r = MeasureRecall(frames, {.radius = 5, .excluded_frames = 0});
  EXPECT_EQ(r.num_queries, 4);
  EXPECT_DOUBLE_EQ(r.recall_at_1, 0.75);  // 4 finds 2 first
  EXPECT_DOUBLE_EQ(r.recall_at_3, 1);
  EXPECT_EQ(MeasureRecall(frames, {.radius = 5, .excluded_frames = 3}).num_queries, 0);
  EXPECT_EQ(MeasureRecall({}, {}).num_queries, 0);
}

}  // namespace recall_test
}  // namespace mapmend

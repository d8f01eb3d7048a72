#include "libs/base/frame_ranges.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace mapmend {
namespace frame_ranges_test {

std::string ErrorOf(const std::string& text) {
  try {
    ParseFrameRanges(text);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(ParseFrameRanges, ReadsRangesAndSingleFrames) {
  EXPECT_EQ(ParseFrameRanges("2-4,7"), (std::set<int>{2, 3, 4, 7}));
  EXPECT_TRUE(ParseFrameRanges("").empty());
}

TEST(ParseFrameRanges, NamesWhatIsMalformed) {
  EXPECT_NE(ErrorOf("2-x").find("--skip-frames 2-x: expected"), std::string::npos);
  EXPECT_NE(ErrorOf("9-2").find("9-2"), std::string::npos);
  for (const char* wrong : {"-3", "a", "5-", "1,,2", "1,", "1-2-3", "1 2", "99999999999"}) {
    EXPECT_NE(ErrorOf(wrong), "") << wrong;
  }
}

}  // namespace frame_ranges_test
}  // namespace mapmend

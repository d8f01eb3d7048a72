#include "libs/base/nearest_word.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace nearest_word_test {

TEST(NearestWord, IsNearOrABeginning) {
  const std::vector<std::string> words = {"run", "replay", "doctor", "--groundtruth", "--realtime"};
  EXPECT_EQ(NearestWord("rn", words), "run");
  EXPECT_EQ(NearestWord("docter", words), "doctor");
  EXPECT_EQ(NearestWord("erplay", words), "replay");
  EXPECT_EQ(NearestWord("--ground", words), "--groundtruth");
  EXPECT_EQ(NearestWord("fly", words), "");
}

}  // namespace nearest_word_test
}  // namespace mapmend

#include "libs/base/rounded.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace rounded_test {

TEST(Rounded, HasNoExponent) {
  EXPECT_EQ(Rounded(49600.4), "49600");
  EXPECT_EQ(Rounded(101.3), "101");
  EXPECT_EQ(Rounded(0.04567), "0.0457");
  EXPECT_EQ(Rounded(999.4), "999");
  EXPECT_EQ(Rounded(999.7), "1000");
}

}  // namespace rounded_test
}  // namespace mapmend

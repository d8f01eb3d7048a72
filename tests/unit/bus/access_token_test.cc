#include "libs/bus/access_token.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace access_token_test {

TEST(AccessToken, IsMadeOnceForItsOwnerAlone) {
  const ScratchFolder folder;
  const std::string path = folder.File("token");
  bool made = false;
  const std::string token = ReadOrMakeToken(path, &made);
  EXPECT_TRUE(made);
  EXPECT_EQ(token.size(), 32u);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  EXPECT_EQ(ReadOrMakeToken(path, &made), token);
  EXPECT_FALSE(made);
  EXPECT_EQ(ReadToken(path), token);
  EXPECT_NE(ReadOrMakeToken(folder.File("other"), &made), token);
}

TEST(AccessToken, ErrorsNameTheFile) {
  const ScratchFolder folder;
  const auto error = [](const auto& call) {
    try {
      call();
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  bool made = false;
  EXPECT_NE(error([&] { ReadToken(folder.File("missing")); }).find("missing"), std::string::npos);
  EXPECT_NE(error([&] { ReadOrMakeToken(folder.File("no/folder"), &made); }).find("no/folder"), std::string::npos);
  std::ofstream(folder.File("short")) << "abc\n";
  EXPECT_NE(error([&] { ReadToken(folder.File("short")); }).find("16 to 256 characters, this one 3"),
            std::string::npos);
  std::ofstream(folder.File("empty")) << "\n";
  EXPECT_NE(error([&] { ReadOrMakeToken(folder.File("empty"), &made); }).find("empty"), std::string::npos);
}

TEST(AccessToken, IsComparedWhole) {
  EXPECT_TRUE(TokensAreEqual("abcdef", "abcdef"));
  EXPECT_FALSE(TokensAreEqual("abcdef", "abcdeg"));
  EXPECT_FALSE(TokensAreEqual("abcdef", "abcde"));
  EXPECT_FALSE(TokensAreEqual("", "a"));
}

}  // namespace access_token_test
}  // namespace mapmend

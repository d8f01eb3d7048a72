#include "libs/base/write_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace write_file_test {

std::string MessageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "nothing was thrown";
}

TEST(WriteFile, WhatIsWrittenIsReadAndNothingElseIsLeft) {
  const ScratchFolder folder;
  const std::string path = folder.File("a");
  std::string content(200000, 'x');
  content[70000] = '\0';
  WriteFile(path, "before");
  WriteFile(path, content);
  EXPECT_EQ(ReadFile(path), content);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path()), {}), 1);
}

TEST(WriteFile, WhatCannotBeIsToldInOneLine) {
  const ScratchFolder folder;
  const std::string absent = folder.File("no/where");
  EXPECT_EQ(MessageOf([&] { WriteFile(absent, "x"); }), "cannot write " + absent + ": No such file or directory");
  EXPECT_EQ(MessageOf([&] { ReadFile(absent); }), "cannot read " + absent + ": No such file or directory");
  EXPECT_EQ(MessageOf([&] { ReadFile(folder.Path()); }), "cannot read " + folder.Path() + ": Is a directory");
  // A folder stands where the file should: what was written beside it is taken away.
  const std::string taken = folder.File("taken");
  std::filesystem::create_directories(taken + "/full");
  EXPECT_THAT(MessageOf([&] { WriteFile(taken, "x"); }), testing::StartsWith("cannot write " + taken + ": "));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.Path()), {}), 1);
}

}  // namespace write_file_test
}  // namespace mapmend

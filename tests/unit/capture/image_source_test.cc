#include "libs/capture/image_source.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "libs/geometry/times_file.h"

namespace mapmend {
namespace {

std::string Flight(const std::string& name) {
  return std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/" + name;
}

std::string ErrorOf(const std::function<void()>& action) {
  try {
    action();
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
  EXPECT_NE(ErrorOf([] { ParseFrameRanges("2-x"); }).find("--skip-frames 2-x: expected"), std::string::npos);
  EXPECT_NE(ErrorOf([] { ParseFrameRanges("9-2"); }).find("9-2"), std::string::npos);
  for (const char* wrong : {"-3", "a", "5-", "1,,2", "1,", "1-2-3", "1 2", "99999999999"}) {
    EXPECT_NE(ErrorOf([&] { ParseFrameRanges(wrong); }), "") << wrong;
  }
}

TEST(ImageSource, SkippedFramesKeepTheIndicesAndTimesOfTheOthers) {
  ImageSource source(Flight("video.mp4"), Flight("times.txt"), 0, {1, 2});
  EXPECT_EQ(source.NumFrames(), 170);
  const auto first = source.Next(), second = source.Next();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->index, 0);
  EXPECT_EQ(first->utime, 1525003606000000);
  EXPECT_EQ(second->index, 3);
  EXPECT_EQ(second->utime, ReadFrameTimes(Flight("times.txt")).utimes[3]);
}

TEST(ImageSource, MissingInputAndShortTimesAreNamed) {
  EXPECT_NE(ErrorOf([] { ImageSource("/no/such/video.mp4", "", 0, {}); }).find("/no/such/video.mp4"),
            std::string::npos);
  const auto path = std::filesystem::temp_directory_path() / ("mapmend_times_" + std::to_string(::getpid()));
  std::ofstream(path) << "1.0\n2.0\n";
  EXPECT_NE(ErrorOf([&] { ImageSource(Flight("video.mp4"), path.string(), 0, {}); }).find("2 times for 172 frames"),
            std::string::npos);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace mapmend

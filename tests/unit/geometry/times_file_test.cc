#include "libs/geometry/times_file.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace times_file_test {

constexpr int64_t kStart = 1525003606000000;

FrameTimes Read(const std::string& content) {
  const ScratchFolder folder;
  WriteFile(folder.File("t.txt"), content);
  return ReadFrameTimes(folder.File("t.txt"));
}

std::string ErrorOf(const std::string& content) {
  try {
    Read(content);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

using Times = std::vector<int64_t>;

TEST(ReadFrameTimes, WhatIsNoDataIsPassedOver) {
  const Times expected = {kStart, kStart + 6000000};
  EXPECT_EQ(Read("1525003606.0\n1525003612.0\n").utimes, expected);
  EXPECT_EQ(Read("1525003606.0\r\n1525003612.0\r\n\r\n").utimes, expected);
  EXPECT_EQ(Read("1525003606.0\r1525003612.0\r").utimes, expected);
  EXPECT_EQ(Read("\xEF\xBB\xBF"
                 "1525003606.0\n1525003612.0\n  \t\n")
                .utimes,
            expected);
  EXPECT_EQ(Read("  # note\n\n 1525003606.0 \n# between\n\t+1525003612\n").utimes, expected);
  EXPECT_EQ(Read("1525003606.0 a.png\n1525003612.0 b.png").utimes, expected);
  EXPECT_EQ(Read("\"1525003606.0\";\"3\"\n\"1525003612.0\";\"7\"").utimes, expected);
  EXPECT_EQ(Read("timestamp,exposure\n1525003606.0,3\n1525003612.0,3").utimes, expected);
  EXPECT_EQ(Read("1.525003606000000000e+09\n1.525003612000000000e+09\n").utimes, expected);
}

TEST(ReadFrameTimes, TheUnitIsToldByMagnitude) {
  const Times expected = {kStart, kStart + 33333, kStart + 66667};
  const FrameTimes euroc = Read(
      "#timestamp [ns],filename\n1525003606000000000,1525003606000000000.png\n"
      "1525003606033333000,1525003606033333000.png\n1525003606066667000,1525003606066667000.png\n");
  EXPECT_EQ(euroc.utimes, expected);
  EXPECT_EQ(euroc.names.at(1), "1525003606033333000.png");
  EXPECT_NE(euroc.note.find("nanoseconds"), std::string::npos) << euroc.note;
  EXPECT_EQ(Read("1525003606000000000\n1525003606033333000\n1525003606066667000\n").utimes, expected);
  EXPECT_EQ(Read("1525003606000000000.000000\n1525003606033333000.0\n1525003606066667000.0\n").utimes, expected);
  EXPECT_EQ(Read("1525003606000000\n1525003606033333\n1525003606066667\n").utimes, expected);
  EXPECT_EQ(Read("1525003606000\n1525003606033.333\n1525003606066.667\n").utimes, expected);
  EXPECT_EQ(Read("1525003606\n1525003606.033333\n1525003606.066667\n").note, "");
  EXPECT_EQ(Read("1525003606000000000\n").utimes, Times{kStart});
}

TEST(ReadFrameTimes, ClocksThatStartAtZeroAreToldByTheirSteps) {
  const Times expected = {0, 33333, 66667};
  EXPECT_EQ(Read("0.0\n0.033333\n0.066667\n").utimes, expected);
  EXPECT_EQ(Read("0\n33333\n66667\n").utimes, expected);
  EXPECT_EQ(Read("0\n33333000\n66667000\n").utimes, expected);
  EXPECT_EQ(Read("0\n33\n67\n").utimes, (Times{0, 33000, 67000}));
  EXPECT_EQ(Read("0\n6\n12\n").utimes, (Times{0, 6000000, 12000000}));  // photos
  EXPECT_EQ(Read("0.0\n60.0\n120.0\n").utimes, (Times{0, 60000000, 120000000}));
  // Ten minutes after switching on, in microseconds: as seconds since 1970 the frames would be hours apart.
  EXPECT_EQ(Read("1525003606\n1525036939\n1525070273\n").utimes, (Times{1525003606, 1525036939, 1525070273}));
  EXPECT_EQ(Read("5000000000000\n5000033333000\n").utimes, (Times{5000000000, 5000033333}));
}

TEST(ReadFrameTimes, TheHeadDecides) {
  EXPECT_EQ(Read("# [s]\n0\n60\n").utimes, (Times{0, 60000000}));
  EXPECT_EQ(Read("time_ms\n0\n5\n").utimes, (Times{0, 5000}));
  EXPECT_EQ(Read("#timestamp [ns],exposure [ms]\n5,1\n9000,1\n").utimes, (Times{0, 9}));
  EXPECT_EQ(Read("# timestamp exposure_ms\n0 5\n6 5\n").utimes, (Times{0, 6000000}));
  EXPECT_EQ(Read("# the camera's times\n0\n33\n").utimes, (Times{0, 33000}));
}

TEST(ReadFrameTimes, ColumnsThatCountAreNoTimes) {
  const Times expected = {kStart, kStart + 6000000};
  const FrameTimes times = Read("0,1525003606.0\n1,1525003612.0\n");
  EXPECT_EQ(times.utimes, expected);
  EXPECT_NE(times.note.find("column 2"), std::string::npos) << times.note;
  EXPECT_EQ(Read("100 1525003606.0\n110 1525003612.0\n").utimes, expected);
  EXPECT_EQ(Read("1\t0.0\n2\t0.1\n").utimes, (Times{0, 100000}));
  EXPECT_EQ(Read("0,0\n1,33\n2,67\n").utimes, (Times{0, 33000, 67000}));
  EXPECT_EQ(Read("frame0.png 1525003606.0\nframe1.png 1525003612.0\n").utimes, expected);
  EXPECT_EQ(Read("0 frame0.png\n1 frame1.png\n").utimes, (Times{0, 1000000}));
  EXPECT_EQ(Read("1525003606.0 0.5 1 2 0 0 0 1\n1525003612.0 0.7 1 2 0 0 0 1\n").utimes, expected);
  EXPECT_EQ(Read("1 0.5 1 2 0 0 0 1\n2 0.7 1 2 0 0 0 1\n").utimes, (Times{1000000, 2000000}));
}

TEST(ReadFrameTimes, ErrorsNameTheLine) {
  const auto expect = [](const std::string& content, const std::string& part) {
    const std::string error = ErrorOf(content);
    EXPECT_NE(error.find(part), std::string::npos) << error;
    EXPECT_NE(error.find("t.txt"), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  };
  expect("1.0\n0.5\n", "line 2: \"0.5\" is not later");
  expect("# head\n\n1.0\n1.0\n", "line 4: \"1.0\" is not later");
  expect("1.0\nabc\n", "line 2: \"abc\" is not a time");
  expect("1.0\nnan\n", "line 2");
  expect("1525003606,5\n1525003612,5\n", "line 1: \"1525003606,5\" looks like a number with a decimal comma");
  expect("0,033\n0,067\n", "decimal comma");
  expect("0,5;a\n1,0;b\n", "decimal comma");
  expect("1525003606\n1525003607\n1525003608000\n", "line 3: \"1525003608000\" is no time in seconds");
  expect("2011-09-26 13:02:25.594\n", "line 1: \"2011-09-26\" is a date");
  expect("", "holds no time");
  expect("# only a head\n", "holds no time");
  expect(std::string("1\0"
                     "2",
                     3),
         "not a text file");
  expect(
      "\xFF\xFE"
      "1",
      "UTF-16");
  EXPECT_THROW(ReadFrameTimes("/no/such/times.txt"), std::runtime_error);
}

TEST(TimesOfNames, OnlyNamesThatAreTimesOfOurDays) {
  const auto tum = TimesOfNames({"1305031102.175304.png", "1305031102.211214.png"});
  ASSERT_TRUE(tum);
  EXPECT_EQ(tum->utimes, (Times{1305031102175304, 1305031102211214}));
  EXPECT_EQ(TimesOfNames({"1403636579763555584.png", "1403636579813555456.png"})->utimes,
            (Times{1403636579763556, 1403636579813555}));
  EXPECT_FALSE(TimesOfNames({"0001.png", "0002.png"}));
  EXPECT_FALSE(TimesOfNames({"frame1.png"}));
  EXPECT_FALSE(TimesOfNames({"1305031102.2.png", "1305031102.1.png"}));
  EXPECT_FALSE(TimesOfNames({"20180429120006.png", "20180429120012.png"}));
  EXPECT_FALSE(TimesOfNames({}));
}

}  // namespace times_file_test
}  // namespace mapmend

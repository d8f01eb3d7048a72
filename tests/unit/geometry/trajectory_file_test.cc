#include "libs/geometry/trajectory_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "libs/base/write_file.h"

namespace mapmend {
namespace trajectory_file_test {

class TrajectoryFileTest : public ::testing::Test {
 protected:
  TrajectoryFileTest()
      : dir_(std::filesystem::temp_directory_path() / ("mapmend_trajectory_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(dir_);
  }
  ~TrajectoryFileTest() override { std::filesystem::remove_all(dir_); }
  std::string Path(const std::string& name) const { return (dir_ / name).string(); }
  std::string ErrorOf(const std::string& content) const {
    WriteFile(Path("bad.tum"), content);
    try {
      ReadTrajectory(Path("bad.tum"));
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }
  std::filesystem::path dir_;
};

int64_t Micros(std::string_view text) {
  int64_t utime = -1;
  return ParseSeconds(text, &utime) ? utime : INT64_MIN;
}

TEST(ParseSecondsTest, IsExactWhereADoubleIsNot) {
  EXPECT_EQ(Micros("1525003606.123457"), 1525003606123457);
  EXPECT_EQ(Micros("900719925474.993001"), 900719925474993001);  // a double holds 16 digits, this has 18
  EXPECT_EQ(Micros("0"), 0);
  EXPECT_EQ(Micros(".5"), 500000);
  EXPECT_EQ(Micros("7."), 7000000);
  EXPECT_EQ(Micros("-1.25"), -1250000);
}

TEST(ParseSecondsTest, RoundsBeyondMicroseconds) {
  EXPECT_EQ(Micros("1.0000004"), 1000000);
  EXPECT_EQ(Micros("1.0000005"), 1000001);
  EXPECT_EQ(Micros("0.0000005"), 1);
  EXPECT_EQ(Micros("0.00000049"), 0);
  EXPECT_EQ(Micros("1.99999999"), 2000000);
}

TEST(ParseSecondsTest, ReadsExponentsAsOtherToolsWriteThem) {
  EXPECT_EQ(Micros("1.525003606123456955e+09"), 1525003606123457);
  EXPECT_EQ(Micros("25e-1"), 2500000);
  EXPECT_EQ(Micros("0e5"), 0);
}

TEST(ParseSecondsTest, RefusesWhatIsNoTime) {
  for (const char* text : {"", "-", ".", "abc", "1.2.3", "1e", "1e5x", "nan", "inf", "1e300", "12345678901234567890"}) {
    EXPECT_EQ(Micros(text), INT64_MIN) << text;
  }
}

TEST(FormatSecondsTest, HasSixDecimals) {
  EXPECT_EQ(FormatSeconds(1525003606000001), "1525003606.000001");
  EXPECT_EQ(FormatSeconds(-1250000), "-1.250000");
  EXPECT_EQ(FormatSeconds(0), "0.000000");
}

TEST_F(TrajectoryFileTest, WhatIsWrittenIsReadBack) {
  Trajectory written;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d(1, 2, 3).normalized()));
    written.push_back({1525003606000001 + i * 33333, Rigid3(q, {1e-5 * i, -123.456789 * i, 1e4 + i})});
  }
  WriteTrajectory(Path("a.tum"), written, "world_from_camera");
  const Trajectory read = ReadTrajectory(Path("a.tum"));
  ASSERT_EQ(read.size(), written.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].utime, written[i].utime);
    EXPECT_LT((read[i].world_from_camera.translation - written[i].world_from_camera.translation).norm(), 1e-5);
    EXPECT_LT(read[i].world_from_camera.rotation.angularDistance(written[i].world_from_camera.rotation), 1e-8);
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(dir_), {}), 1) << "a temporary file was left";
}

TEST_F(TrajectoryFileTest, CommentsBlankLinesAndTabsAreAccepted) {
  WriteFile(Path("a.tum"), "# t tx ty tz\n\n1.5\t1 2 3 0 0 0 1\r\n  2.5 +4 5e0 6 0 0 1 0");
  const Trajectory read = ReadTrajectory(Path("a.tum"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].utime, 1500000);
  EXPECT_EQ(read[1].world_from_camera.translation, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(read[1].world_from_camera.rotation.z(), 1.0);
}

TEST_F(TrajectoryFileTest, ErrorsNameFileAndLine) {
  const std::string file = Path("bad.tum");
  EXPECT_NE(ErrorOf("# head\n1 2 3\n").find(file + ":2: expected 8 numbers (t tx ty tz qx qy qz qw)"),
            std::string::npos);
  EXPECT_NE(ErrorOf("1 0 0 0 0 0 0 1 9\n").find("found 9"), std::string::npos);
  EXPECT_NE(ErrorOf("1 0 0 0 0 0 0 1\n2 0 0 0\n").find(file + ":2: expected 8 numbers"), std::string::npos);
  EXPECT_EQ(ErrorOf("x 0 0 0 0 0 0 1\n"), file + ":1: bad time 'x'");
  EXPECT_EQ(ErrorOf("1 0 0 inf 0 0 0 1\n"), file + ":1: bad number 'inf'");
  EXPECT_EQ(ErrorOf("1 0 0 nan 0 0 0 1\n"), file + ": no pose that is a number");
  EXPECT_EQ(ErrorOf("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 0.5\n"), file + ":2: the quaternion's length is 0.500000, not 1");
  EXPECT_EQ(ErrorOf("# nothing\n"), file + ": no poses (expected lines `t tx ty tz qx qy qz qw`)");
  EXPECT_THROW(ReadTrajectory(Path("missing.tum")), std::runtime_error);
  EXPECT_THROW(WriteTrajectory(Path("no/such/dir.tum"), {}, ""), std::runtime_error);
}

}  // namespace trajectory_file_test
}  // namespace mapmend

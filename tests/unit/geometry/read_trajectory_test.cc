#include "libs/geometry/read_trajectory.h"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace read_trajectory_test {

constexpr int64_t kStart = 1525003606000000;

TrajectoryFile Read(const std::string& content, const std::vector<int64_t>& frame_times = {}) {
  const ScratchFolder folder;
  WriteFile(folder.File("gt"), content);
  return ReadTrajectoryFile(folder.File("gt"), frame_times);
}

std::string ErrorOf(const std::string& content, const std::vector<int64_t>& frame_times = {}) {
  try {
    Read(content, frame_times);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

// Two poses: the second is 6 s later, at (8, -1, 70), turned by 120 degrees about (1, 1, 1).
void ExpectPoses(const TrajectoryFile& file, bool rotations = true) {
  ASSERT_EQ(file.poses.size(), 2u);
  EXPECT_EQ(file.poses[0].utime, kStart);
  EXPECT_EQ(file.poses[1].utime, kStart + 6000000);
  EXPECT_EQ(file.poses[1].world_from_camera.translation, Eigen::Vector3d(8, -1, 70));
  EXPECT_EQ(file.has_rotations, rotations);
  const Eigen::Quaterniond expected =
      rotations ? Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5) : Eigen::Quaterniond(1, 0, 0, 0);
  EXPECT_LT(file.poses[1].world_from_camera.rotation.angularDistance(expected), 1e-9);
}

TEST(ReadTrajectoryFile, Tum) {
  const std::string tum = "1525003606.0 0 0 70 0 0 0 1\n1525003612.0 8 -1 70 0.5 0.5 0.5 0.5\n";
  ExpectPoses(Read(tum));
  EXPECT_EQ(Read(tum).note, "");
  EXPECT_EQ(Read(tum).format, "TUM");
  EXPECT_EQ(Read("# timestamp tx ty tz qx qy qz qw\n" + tum).note, "");
  ExpectPoses(Read("\xEF\xBB\xBF" + tum));
  ExpectPoses(Read("1525003606.0,0,0,70,0,0,0,1\r\n1525003612.0,8,-1,70,0.5,0.5,0.5,0.5\r\n\r\n"));
  ExpectPoses(Read("1525003606.0; 0; 0; 70; 0; 0; 0; 1\n1525003612.0; 8; -1; 70; 0.5; 0.5; 0.5; 0.5\n"));
}

TEST(ReadTrajectoryFile, NanosecondsOfOrbSlam3) {
  const TrajectoryFile file =
      Read("1525003606000000000.000000 0 0 70 0 0 0 1\n1525003612000000000.000000 8 -1 70 0.5 0.5 0.5 0.5\n");
  ExpectPoses(file);
  EXPECT_NE(file.note.find("times in nanoseconds"), std::string::npos) << file.note;
}

TEST(ReadTrajectoryFile, EurocHasWFirst) {
  const std::string rows =
      "1525003606000000000,0,0,70,1,0,0,0,0,0,0,0,0,0,0,0,0\n"
      "1525003612000000000,8,-1,70,0.5,0.5,0.5,0.5,0,0,0,0,0,0,0,0,0\n";
  ExpectPoses(Read(rows));
  ExpectPoses(
      Read("#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v..\n" +
           rows));
  // The first is not turned: with w taken for x it would be.
  EXPECT_NEAR(Read(rows).poses[0].world_from_camera.rotation.w(), 1, 1e-12);
  const std::string eight =
      "timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1525003606.0,0,0,70,1,0,0,0\n1525003612.0,8,-1,70,0.5,0.5,0.5,0.5\n";
  ExpectPoses(Read(eight));
  EXPECT_NEAR(Read(eight).poses[0].world_from_camera.rotation.w(), 1, 1e-12);
}

TEST(ReadTrajectoryFile, PositionsAlone) {
  ExpectPoses(Read("1525003606.0 0 0 70\n1525003612.0 8 -1 70\n"), false);
  ExpectPoses(Read("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z "
                   "[m]\n1525003606000000000,0,0,70\n1525003612000000000,8,-1,70\n"),
              false);
  const TrajectoryFile gps = Read("1525003606.0 0 0 70 0 0 0 0\n1525003612.0 8 -1 70 0 0 0 0\n");
  ExpectPoses(gps, false);
  EXPECT_NE(gps.note.find("positions without rotations"), std::string::npos) << gps.note;
  ExpectPoses(Read("id,time,x,y,z\n1,1525003606.0,0,0,70\n2,1525003612.0,8,-1,70\n"), false);
}

TEST(ReadTrajectoryFile, KittiTakesTheTimesOfTheFrames) {
  const std::string kitti = "1 0 0 0 0 1 0 0 0 0 1 70\n0 0 1 8 1 0 0 -1 0 1 0 70\n";
  ExpectPoses(Read(kitti, {kStart, kStart + 6000000}));
  EXPECT_NE(ErrorOf(kitti).find("has no times; give those of the frames with --times"), std::string::npos);
  EXPECT_NE(ErrorOf(kitti, {kStart}).find("2 poses for 1 times"), std::string::npos);
  EXPECT_NE(ErrorOf("1 0 0 0 0 1 0 0 0 0 2 70\n", {kStart}).find(":1: the matrix is not a rotation"),
            std::string::npos);
}

TEST(ReadTrajectoryFile, LinesWithoutNumbersAreLeftOutAndCounted) {
  const TrajectoryFile file = Read(
      "1525003606.0 0 0 70 0 0 0 1\n1525003609.0 nan nan nan nan nan nan nan\n1525003612.0 8 -1 70 0.5 0.5 0.5 0.5\n");
  ExpectPoses(file);
  EXPECT_EQ(file.num_left_out, 1);
  EXPECT_NE(file.note.find("1 line that is not a number left out"), std::string::npos) << file.note;
}

TEST(ReadGroundTruth, ShiftsTimes) {
  const ScratchFolder folder;
  WriteFile(folder.File("gt"), "0.0 0 0 70\n6.0 8 -1 70\n");
  ExpectPoses(ReadGroundTruth(folder.File("gt"), "", 1525003606), false);
  WriteFile(folder.File("kitti"), "1 0 0 0 0 1 0 0 0 0 1 70\n0 0 1 8 1 0 0 -1 0 1 0 70\n");
  WriteFile(folder.File("times"), "0.0\n6.0\n");
  ExpectPoses(ReadGroundTruth(folder.File("kitti"), folder.File("times"), 1525003606));
}

TEST(ReadTrajectoryFile, DamagedFilesAreReadOrRefused) {
  std::mt19937 random(3);
  int num_read = 0, num_refused = 0;
  const std::string seeds[] = {"1525003606.0 0 0 70 0 0 0 1\n1525003612.0 8 -1 70 0.5 0.5 0.5 0.5\n",
                               "#t,x,y,z\n1525003606000000000,0,0,70\n1525003612000000000,8,-1,70\n",
                               "1 0 0 0 0 1 0 0 0 0 1 70\n0 0 1 8 1 0 0 -1 0 1 0 70\n"};
  for (int i = 0; i < 1500; ++i) {
    std::string text = seeds[i % 3];
    for (int k = static_cast<int>(random() % 3); k >= 0 && !text.empty(); --k) {
      const size_t at = random() % text.size();
      if (random() % 3 == 0)
        text.erase(at, 1 + random() % 4);
      else if (random() % 2 == 0)
        text[at] = "0123456789.-e,; \n#"[random() % 18];
      else
        text[at] = static_cast<char>(random());
    }
    const std::string error = ErrorOf(text, {kStart, kStart + 6000000});
    ASSERT_EQ(error.find('\n'), std::string::npos) << error;
    ++(error.empty() ? num_read : num_refused);
  }
  EXPECT_GT(num_read, 50);
  EXPECT_GT(num_refused, 50);
}

}  // namespace read_trajectory_test
}  // namespace mapmend

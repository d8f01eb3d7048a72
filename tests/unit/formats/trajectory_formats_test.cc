#include "libs/formats/trajectory_formats.h"

#include <gtest/gtest.h>

#include <sstream>

#include "libs/base/write_file.h"
#include "libs/formats/g2o.h"
#include "libs/geometry/read_trajectory.h"
#include "tests/scratch_folder.h"
#include "tests/unit/formats/test_map.h"

namespace mapmend {
namespace trajectory_formats_test {

void ExpectSame(const Trajectory& read, const PlacedMap& map) {
  ASSERT_EQ(read.size(), map.frames.size());
  for (size_t i = 0; i < read.size(); ++i) {
    const Rigid3& pose = map.frames[i].world_from_camera;
    EXPECT_EQ(read[i].utime, map.frames[i].utime);
    EXPECT_LT((read[i].world_from_camera.translation - pose.translation - map.frame.origin).norm(), 1e-4);
    EXPECT_LT(RotationAngle(read[i].world_from_camera.rotation.conjugate() * pose.rotation), 1e-9);
  }
}

TEST(TrajectoryFormats, KittiIsReadBackWithItsTimes) {
  const ScratchFolder folder;
  for (const PlacedMap& map : {MakeTestMap(), MakeUtmMap()}) {
    WriteFile(folder.File("poses.txt"), KittiPoses(map));
    std::vector<int64_t> times;
    std::istringstream lines(KittiTimes(map));
    std::string time;
    for (int session, frame; lines >> time >> session >> frame;) {
      EXPECT_EQ(session, 0);
      EXPECT_EQ(frame, map.frames[times.size()].frame);
      EXPECT_EQ(time, FormatSeconds(map.frames[times.size()].utime));
      times.push_back(map.frames[times.size()].utime);
    }
    const TrajectoryFile file = ReadTrajectoryFile(folder.File("poses.txt"), times);
    EXPECT_NE(file.format.find("KITTI"), std::string::npos) << file.format;
    ExpectSame(file.poses, map);
  }
}

TEST(TrajectoryFormats, EurocIsReadBack) {
  const ScratchFolder folder;
  WriteFile(folder.File("data.csv"), EurocCsv(MakeUtmMap()));
  const TrajectoryFile file = ReadTrajectoryFile(folder.File("data.csv"));
  EXPECT_NE(file.format.find("EuRoC"), std::string::npos) << file.format;
  ExpectSame(file.poses, MakeUtmMap());
}

TEST(G2o, EdgesAgreeWithTheVerticesThatTheyJoin) {
  const PlacedMap map = MakeUtmMap();
  std::istringstream lines(PoseGraphG2o(map));
  std::vector<Rigid3> vertices;
  std::vector<std::string> comments;
  int num_edges = 0, fixed = -1;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string tag;
    words >> tag;
    std::array<double, 7> v;
    if (tag == "#") {
      comments.push_back(line);
    } else if (tag == "FIX") {
      words >> fixed;
    } else if (tag == "VERTEX_SE3:QUAT") {
      size_t id;
      words >> id;
      for (double& x : v) words >> x;
      EXPECT_EQ(id, vertices.size());
      vertices.push_back(RigidFromArray(v.data()));
    } else {
      ASSERT_EQ(tag, "EDGE_SE3:QUAT");
      int a, b;
      words >> a >> b;
      for (double& x : v) words >> x;
      const Rigid3 error = RigidFromArray(v.data()).Inverse() * vertices.at(a).Inverse() * vertices.at(b);
      EXPECT_LT(error.translation.norm(), 1e-3) << "coordinates of seven digits in front of the point";
      EXPECT_LT(RotationAngle(error.rotation), 1e-6);
      std::vector<double> information;
      for (double x; words >> x;) information.push_back(x);
      ASSERT_EQ(information.size(), 21u);
      EXPECT_NEAR(information[0], 100, 1e-6);
      EXPECT_NEAR(information[15], 40000, 1e-3) << "half the angle counts";
      EXPECT_EQ(information[1], 0);
      ++num_edges;
    }
    EXPECT_FALSE(words.bad());
  }
  EXPECT_EQ(vertices.size(), 3u);
  EXPECT_EQ(num_edges, 3);
  EXPECT_EQ(fixed, 0);
  EXPECT_NE(comments.at(1).find("EPSG:32630"), std::string::npos) << comments.at(1);
}

}  // namespace trajectory_formats_test
}  // namespace mapmend

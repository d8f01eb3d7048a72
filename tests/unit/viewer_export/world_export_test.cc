#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "libs/base/write_file.h"
#include "procs/viewer_export/exporter.h"
#include "tests/scratch_folder.h"
#include "tests/test_flight.h"

namespace mapmend {
namespace world_export_test {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

const Geodetic kOrigin{28.04, -82.7, 5};

// The records of a flight with a position for every frame.
MapModel MakePlacedModel(const TestFlight& flight, int num_frames, int64_t clock_us = 0) {
  const LocalFrame frame(kOrigin);
  PositionsRecord positions;
  for (int i = 0; i < num_frames; ++i) {
    const Geodetic place = frame.ToGeodetic(flight.WorldFromCamera(i).translation);
    PositionFix fix;
    fix.utime = TestFlight::Utime(i) + clock_us;
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.altitude_m = place.altitude_m;
    positions.fixes.push_back(fix);
  }
  MapModel model;
  int64_t seq = 0;
  for (Record record : flight.Records()) {
    record.header.seq = seq++;
    EXPECT_EQ(model.Apply(record), "");
    if (record.header.seq > 0) continue;
    const Record told{{record.header.session, seq++, record.header.utime}, positions};
    EXPECT_EQ(model.Apply(told), "");
  }
  return model;
}

class WorldExportTest : public ::testing::Test {
 protected:
  WorldExportTest() {
    TestFlightOptions options;
    options.num_submaps = 3;  // frames 0 to 69
    flight_ = std::make_unique<TestFlight>(options);
  }
  void Export(const std::string& frame, bool is_joined, int64_t clock_us = 0, const GroundTruth* truth = nullptr) {
    MapModel model = MakePlacedModel(*flight_, 75, clock_us);
    if (is_joined) model.SetRevision(flight_->Revision());
    ExportOptions options;
    options.frame = frame;
    options.ground_truth_origin = kOrigin;
    EXPECT_EQ(ExportAll(model, truth, folder_.Path(), options), std::vector<std::string>());
  }
  std::string Read(const std::string& name) const { return ReadFile(folder_.File(name)); }
  nlohmann::json Json(const std::string& name) const { return nlohmann::json::parse(Read(name)); }
  // Where a frame is, east, north, up from the first fix.
  Eigen::Vector3d Truth(int frame) const {
    const LocalFrame world(kOrigin);
    const LocalFrame first(world.ToGeodetic(flight_->WorldFromCamera(0).translation));
    return first.ToEnu(world.ToGeodetic(flight_->WorldFromCamera(frame).translation));
  }
  void ExpectTrue(const std::string& name, double tolerance) const {
    for (const StampedPose& pose : ReadTrajectory(folder_.File(name))) {
      const int frame = static_cast<int>((pose.utime - TestFlight::Utime(0)) / 100000);
      EXPECT_LT((pose.world_from_camera.translation - Truth(frame)).norm(), tolerance) << name << " " << frame;
      const Eigen::Quaterniond off =
          pose.world_from_camera.rotation * flight_->WorldFromCamera(frame).rotation.conjugate();
      EXPECT_LT(RotationAngle(off), 1e-3);
    }
  }

  ScratchFolder folder_;
  std::unique_ptr<TestFlight> flight_;
};

TEST_F(WorldExportTest, TrajectoriesInEastNorthUp) {
  GroundTruth truth;
  for (int i = 0; i < 75; ++i) truth.trajectory.push_back({TestFlight::Utime(i), flight_->WorldFromCamera(i)});
  Export("enu", true, 0, &truth);
  ExpectTrue("frames.tum", 0.06);  // fixes between the submaps lie beside the straight line
  ExpectTrue("keyframes.tum", 0.06);
  EXPECT_THAT(Read("frames.tum"), HasSubstr("east, north, up; origin: 28.04"));
  const nlohmann::json world = Json("summary.json")["world"];
  EXPECT_EQ(world["positions"], 75);
  const nlohmann::json& component = world["components"][0];
  EXPECT_LT(component["horizontal_residual_median_m"].get<double>(), 0.02);
  EXPECT_LT(component["groundtruth"]["horizontal_rmse_m"].get<double>(), 0.02);
  EXPECT_LT(component["groundtruth"]["vertical_rmse_m"].get<double>(), 0.02);
  EXPECT_NEAR(component["enu_from_root"][7].get<double>(), 10, 0.01);
  EXPECT_THAT(Read("report.html"), HasSubstr("Where on the earth"));
}

TEST_F(WorldExportTest, OnTheGrid) {
  Export("utm", true);
  const LocalFrame world(kOrigin);
  const UtmFrame utm(kOrigin);
  const Trajectory frames = ReadTrajectory(folder_.File("frames.tum"));
  ASSERT_EQ(frames.size(), 60u);
  for (const StampedPose& pose : frames) {
    const int frame = static_cast<int>((pose.utime - TestFlight::Utime(0)) / 100000);
    const Eigen::Vector3d place = utm.FromGeodetic(world.ToGeodetic(flight_->WorldFromCamera(frame).translation));
    EXPECT_LT((pose.world_from_camera.translation - place).norm(), 0.08) << frame;
  }
  // The camera's right side points east, on the grid a little aside.
  const Eigen::Vector3d right = frames[0].world_from_camera.rotation * Eigen::Vector3d::UnitX();
  const double convergence = utm.ConvergenceDeg(kOrigin) * M_PI / 180;
  EXPECT_NEAR(std::atan2(right.y(), right.x()), convergence, 1e-3);
  EXPECT_THAT(Read("frames.tum"), HasSubstr("EPSG:32617"));
}

TEST_F(WorldExportTest, InTheMapsFrameNothingIsMoved) {
  Export("map", true);
  const std::string placed = Read("frames.tum"), ply = Read("map.ply");
  MapModel model = MakeModel(*flight_);
  model.SetRevision(flight_->Revision());
  ExportAll(model, nullptr, folder_.Path());
  EXPECT_EQ(Read("frames.tum"), placed);
  EXPECT_EQ(Read("map.ply"), ply);
  // What only a map with positions has is gone.
  EXPECT_FALSE(fs::exists(folder_.File("path.geojson")));
  EXPECT_FALSE(fs::exists(folder_.File("gaps.plan")));
  EXPECT_FALSE(Json("summary.json").contains("world"));
}

TEST_F(WorldExportTest, PartsThatNothingJoinsLieInOneWorld) {
  Export("enu", false);
  ExpectTrue("frames.tum", 0.1);
  ExpectTrue("components/1/frames.tum", 0.1);
  ExpectTrue("components/2/frames.tum", 0.1);
  int num_connections = 0;
  const nlohmann::json summary = Json("summary.json");
  for (const nlohmann::json& gap : summary["gaps"]["list"]) num_connections += gap["kind"] == "connection";
  EXPECT_EQ(num_connections, 2);
}

TEST_F(WorldExportTest, AClockThatIsWrongIsTold) {
  Export("enu", true, 1500000);
  const nlohmann::json clock = Json("summary.json")["world"]["clocks"][0];
  EXPECT_NEAR(clock["offset_s"].get<double>(), -1.5, 0.05);
  EXPECT_THAT(Read("report.html"), HasSubstr("behind that of the receiver"));
  ExpectTrue("frames.tum", 0.3);
}

TEST_F(WorldExportTest, FilesForMapsAndAutopilots) {
  Export("map", false);
  for (const char* name : {"path.geojson", "gaps.geojson"}) {
    const nlohmann::json json = Json(name);
    EXPECT_EQ(json["type"], "FeatureCollection");
    ASSERT_GT(json["features"].size(), 2u) << name;
    for (const nlohmann::json& feature : json["features"]) {
      nlohmann::json at = feature["geometry"]["coordinates"];
      while (at[0].is_array()) at = at[0];
      EXPECT_NEAR(at[0].get<double>(), -82.7, 0.01) << name;
      EXPECT_NEAR(at[1].get<double>(), 28.04, 0.01) << name;
    }
  }
  std::set<std::string> kinds;
  const nlohmann::json path = Json("path.geojson");
  for (const nlohmann::json& feature : path["features"]) kinds.insert(feature["properties"]["kind"]);
  EXPECT_THAT(kinds, ::testing::IsSupersetOf({"path", "losses", "submaps", "footprints"}));
  EXPECT_THAT(Read("map.kml"), HasSubstr("<name>gaps</name>"));

  const nlohmann::json mission = Json("gaps.plan")["mission"];
  std::map<int, int> commands;
  double lowest = 1e9, highest = 0;
  for (const nlohmann::json& item : mission["items"]) {
    ++commands[item["command"].get<int>()];
    if (item["command"] != 16) continue;
    lowest = std::min(lowest, item["params"][6].get<double>());
    highest = std::max(highest, item["params"][6].get<double>());
    EXPECT_NEAR(item["params"][4].get<double>(), 28.04, 0.01);
  }
  EXPECT_EQ(commands[22], 1);
  EXPECT_EQ(commands[20], 1);
  EXPECT_GE(commands[16], 4);
  EXPECT_EQ(commands[206] % 2, 0);  // images begin and end
  EXPECT_NEAR(lowest, 50, 2);       // the flight's height above the ground
  EXPECT_EQ(lowest, highest);
  std::istringstream waypoints(Read("gaps.waypoints"));
  std::string line;
  std::getline(waypoints, line);
  EXPECT_EQ(line, "QGC WPL 110");
  int num_lines = 0;
  for (; std::getline(waypoints, line); ++num_lines) EXPECT_EQ(std::count(line.begin(), line.end(), '\t'), 11) << line;
  EXPECT_EQ(num_lines, static_cast<int>(mission["items"].size()) + 1);
}

TEST_F(WorldExportTest, OtherProgramsOpenThem) {
  if (std::system("command -v ogrinfo > /dev/null 2>&1") != 0) GTEST_SKIP() << "ogrinfo (gdal-bin) is not installed";
  Export("map", false);
  for (const char* name : {"path.geojson", "gaps.geojson", "map.kml", "gaps.kml"}) {
    const std::string out = folder_.File("ogrinfo.txt");
    EXPECT_EQ(std::system(("ogrinfo -al -so -ro " + folder_.File(name) + " > " + out + " 2>&1").c_str()), 0) << name;
    const std::string text = ReadFile(out);
    EXPECT_THAT(text, HasSubstr("WGS 84")) << name;
    EXPECT_THAT(text, HasSubstr("Feature Count: ")) << name;
    EXPECT_EQ(text.find("Feature Count: 0"), std::string::npos) << name << "\n" << text;
    EXPECT_EQ(text.find("Warning"), std::string::npos) << name << "\n" << text;
  }
}

TEST_F(WorldExportTest, WithoutPositionsGapsAreInMapUnits) {
  MapModel model = MakeModel(*flight_);
  model.SetRevision(flight_->Revision());
  ExportAll(model, nullptr, folder_.Path());
  const nlohmann::json gaps = Json("summary.json")["gaps"];
  EXPECT_EQ(gaps["unit"], "map units");
  ASSERT_GE(gaps["list"].size(), 2u);
  EXPECT_EQ(gaps["list"][0]["kind"], "stretch");
  EXPECT_EQ(gaps["list"][0]["first_frame"], 20);
  EXPECT_EQ(gaps["list"][0]["last_frame"], 24);
  EXPECT_NEAR(gaps["list"][0]["length"].get<double>(), 3, 0.1);  // 30 m, the unit is 10
  EXPECT_THAT(Read("report.html"), HasSubstr("What to fly again"));
}

}  // namespace world_export_test
}  // namespace mapmend

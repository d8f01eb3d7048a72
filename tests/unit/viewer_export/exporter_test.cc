#include "procs/viewer_export/exporter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "libs/base/write_file.h"
#include "procs/viewer_export/graph_export.h"
#include "tests/test_flight.h"

namespace mapmend {
namespace exporter_test {

using ::testing::HasSubstr;
using ::testing::Not;
namespace fs = std::filesystem;

class ExporterTest : public ::testing::Test {
 protected:
  ExporterTest() : dir_(fs::temp_directory_path() / ("mapmend_exporter_" + std::to_string(getpid()))) {
    fs::remove_all(dir_);
  }
  ~ExporterTest() override { fs::remove_all(dir_); }
  std::string Read(const std::string& name) const { return ReadFile((dir_ / name).string()); }
  nlohmann::json Summary() const { return nlohmann::json::parse(Read("summary.json")); }
  static GroundTruth Truth(const TestFlight& flight, int num_frames) {
    GroundTruth truth;
    truth.file = "gt.tum";
    for (int i = 0; i < num_frames; ++i) truth.trajectory.push_back({TestFlight::Utime(i), flight.WorldFromCamera(i)});
    return truth;
  }
  fs::path dir_;
};

TEST_F(ExporterTest, ASplitMapIsWrittenWithAllItsFiles) {
  TestFlightOptions options;
  options.num_submaps = 3;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  merged.transforms.submaps[2].component = 1;
  merged.transforms.submaps[2].root_from_submap = Similarity3();
  merged.transforms.submaps[2].is_root = true;
  for (EvaluatedConnection& c : merged.connections) {
    if (c.b == flight.Key(2)) c.verdict = EvaluatedConnection::Verdict::kRejected, c.in_tree = false;
  }
  model.SetRevision(merged);
  ExportAll(model, nullptr, dir_.string());

  const Trajectory frames = ReadTrajectory((dir_ / "frames.tum").string());
  ASSERT_EQ(frames.size(), 40u);
  EXPECT_EQ(frames[20].utime, TestFlight::Utime(25));
  for (const StampedPose& pose : frames) {  // root units are 10 m
    const int frame = static_cast<int>((pose.utime - TestFlight::Utime(0)) / 100000);
    const Eigen::Vector3d world = flight.WorldFromSubmap(0) * pose.world_from_camera.translation;
    EXPECT_LT((world - flight.WorldFromCamera(frame).translation).norm(), 1e-4);
  }
  EXPECT_EQ(ReadTrajectory((dir_ / "keyframes.tum").string()).size(), 10u);
  EXPECT_EQ(ReadTrajectory((dir_ / "components/1/frames.tum").string()).size(), 20u);
  EXPECT_EQ(ReadTrajectory((dir_ / "components/1/keyframes.tum").string()).size(), 5u);
  for (const char* id : {"0", "1", "2"}) {
    const Trajectory tracked = ReadTrajectory((dir_ / "submaps" / id / "frames.tum").string());
    ASSERT_EQ(tracked.size(), 20u);
    EXPECT_LT(tracked[0].world_from_camera.translation.norm(), 1e-6) << "as tracked: in the submap's own frame";
  }
  const auto summary = Summary();
  EXPECT_EQ(summary["restoration"].size(), 4u);
  EXPECT_EQ(summary["restoration"][2]["L2_letters"], "B-A");
  EXPECT_EQ(summary["restoration"][3]["L1_letters"], "B-A");
  EXPECT_EQ(summary["restoration"][3]["L2_letters"], "C");
  EXPECT_THAT(Read("report.html"),
              HasSubstr(">B-A</td><td class=\"text\" data-label=\"Map being tracked (L2)\">C</td>"));
  EXPECT_EQ(summary["frames_in"], 75);
  EXPECT_EQ(summary["frames_tracked"], 60);
  EXPECT_EQ(summary["frames_in_main"], 40);
  EXPECT_EQ(summary["losses"], 2);
  EXPECT_EQ(summary["keyframes_total"], 15);
  EXPECT_EQ(summary["keyframes_in_main"], 10);
  EXPECT_EQ(summary["points_in_main"], 24);
  EXPECT_EQ(summary["components"][1]["submaps"], nlohmann::json({2}));
  EXPECT_EQ(summary["components"][1]["frames"], 20);
  EXPECT_EQ(summary["submaps"][2]["component"], 1);
  ASSERT_EQ(summary["likely_places"].size(), 1u);  // of what nothing joins
  EXPECT_EQ(summary["likely_places"][0]["kind"], "dead_reckoning");
  EXPECT_EQ(summary["likely_places"][0]["a"], 1);
  EXPECT_EQ(summary["likely_places"][0]["b"], 2);
  EXPECT_GT(summary["likely_places"][0]["distance_sigma"], 0.0);
  EXPECT_THAT(Read("report.html"), HasSubstr("if the camera went on as before and behind it, frame 50 was"));
  EXPECT_EQ(summary["submaps"][0]["end_reason"], "too_few_matches");
  EXPECT_EQ(summary["submaps"][2]["end_reason"], "end_of_input");
  const auto& connection = summary["connections"][0];
  EXPECT_EQ(connection["a"], 0);
  EXPECT_EQ(connection["b"], 1);
  EXPECT_EQ(connection["F"], 9);
  EXPECT_EQ(connection["M"], 340);
  EXPECT_NEAR(connection["scale"].get<double>(), 2.0, 1e-9);
  EXPECT_EQ(connection["verdict"], "accepted");
  EXPECT_EQ(connection["in_tree"], true);
  EXPECT_FALSE(summary.contains("wall_s"));
  EXPECT_FALSE(summary.contains("ate_rmse_m"));
  const std::string report = Read("report.html");
  EXPECT_THAT(report, HasSubstr("The map is in 2 parts"));
  EXPECT_THAT(report, HasSubstr("66.7 %"));
  EXPECT_THAT(report, HasSubstr("Part 1 from above"));
  EXPECT_THAT(report, HasSubstr("2 connections to other parts were tried"));
}

TEST_F(ExporterTest, LoopsWithinASubmapAreToldApartFromConnections) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  EvaluatedConnection loop = merged.connections[0];
  loop.a = loop.b = flight.Key(1);
  loop.b_from_a = Similarity3();
  loop.in_tree = false;
  loop.num_connected_frames = 17;
  loop.reason = "17 pairs of keyframes at 2 places";
  merged.connections.push_back(loop);
  model.SetRevision(merged);
  ExportAll(model, nullptr, dir_.string());
  const auto summary = Summary();
  EXPECT_EQ(summary["connections"].size(), 1u);
  ASSERT_EQ(summary["loops"].size(), 1u);
  EXPECT_EQ(summary["loops"][0]["a"], 1);
  EXPECT_EQ(summary["loops"][0]["b"], 1);
  EXPECT_EQ(summary["loops"][0]["F"], 17);
  EXPECT_EQ(summary["loops"][0]["verdict"], "accepted");
  EXPECT_THAT(Read("report.html"), HasSubstr("17 pairs of keyframes at 2 places"));
}

TEST_F(ExporterTest, FormatsAreWrittenOnDemandAndKeptUpToDate) {
  TestFlightOptions options;
  options.num_submaps = 3;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  merged.transforms.submaps[2].component = 1;
  merged.transforms.submaps[2].is_root = true;
  model.SetRevision(merged);
  ExportOptions wanted;
  ExportAll(model, nullptr, dir_.string(), wanted);
  EXPECT_FALSE(fs::exists(dir_ / "map.las"));
  wanted.formats = {"las", "tum"};
  wanted.frame = "level";
  EXPECT_TRUE(ExportAll(model, nullptr, dir_.string(), wanted).empty());
  EXPECT_EQ(fs::file_size(dir_ / "map.las"), 375u + 24 * 36);
  EXPECT_EQ(fs::file_size(dir_ / "components/1/map.las"), 375u + 12 * 36);
  EXPECT_EQ(Summary()["frame"], "level");
  EXPECT_THAT(Read("frames.tum"), HasSubstr("world: frame level, unit map units (arbitrary)"));
  for (const StampedPose& pose : ReadTrajectory((dir_ / "frames.tum").string()))
    EXPECT_NEAR(pose.world_from_camera.translation.z(), 5, 0.2) << "50 m above the ground";

  // Another map in the same folder, all in one component; nobody asks for LAS.
  MapModel joined = MakeModel(flight);
  joined.SetRevision(flight.Revision());
  EXPECT_TRUE(ExportAll(joined, nullptr, dir_.string()).empty());
  EXPECT_EQ(fs::file_size(dir_ / "map.las"), 375u + 36 * 36) << "no file of an older map";
  EXPECT_FALSE(fs::exists(dir_ / "components/1"));
  EXPECT_EQ(Summary()["frame"], "map");
}

TEST_F(ExporterTest, GroundTruthGivesErrorsInMetres) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  const GroundTruth truth = Truth(flight, 50);
  ExportAll(model, &truth, dir_.string());
  const auto summary = Summary();
  EXPECT_LT(summary["ate_rmse_m"].get<double>(), 1e-4);
  EXPECT_NEAR(summary["groundtruth_scale"].get<double>(), 10.0, 1e-4);
  EXPECT_NEAR(summary["groundtruth_coverage"].get<double>(), 0.8, 1e-12);
  EXPECT_LT(summary["submaps"][1]["ate_max_m"].get<double>(), 1e-4);
  EXPECT_LT(summary["submaps"][1]["max_error_of_depth"].get<double>(), 1e-4);
  EXPECT_NEAR(summary["submaps"][1]["scene_depth_m"].get<double>(), 50, 1.0);  // the camera rises and falls by 1 m
  EXPECT_THAT(Read("trajectory.svg"), HasSubstr("ground truth"));
  EXPECT_THAT(Read("report.html"), HasSubstr("error (ATE RMSE)"));
}

TEST_F(ExporterTest, TheLargestErrorIsAShareOfTheDistanceToTheScene) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  GroundTruth truth = Truth(flight, 50);
  truth.trajectory[31].world_from_camera.translation.z() +=
      5;  // a tenth of the height; the alignment takes up some of it
  ExportAll(model, &truth, dir_.string());
  const auto summary = Summary();
  const auto& submap = summary["submaps"][1];
  EXPECT_EQ(submap["max_error_of_depth_frame"], 31);
  EXPECT_GT(submap["max_error_of_depth"].get<double>(), 0.05);
  EXPECT_LT(submap["max_error_of_depth"].get<double>(), 0.1);
  EXPECT_LT(summary["submaps"][0]["max_error_of_depth"].get<double>(), 1e-4);
  EXPECT_EQ(summary["max_error_of_depth"], submap["max_error_of_depth"]);
  EXPECT_THAT(Read("report.html"), HasSubstr("Max of depth"));
}

TEST_F(ExporterTest, PlyFilesHoldPointsWithColoursAndThePath) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  ExportAll(model, nullptr, dir_.string());
  const std::string ply = Read("map.ply");
  const size_t count = 24;
  EXPECT_THAT(ply.substr(0, 200), HasSubstr("format binary_little_endian 1.0\n"));
  EXPECT_THAT(ply, HasSubstr("element vertex " + std::to_string(count) + "\n"));
  const size_t body = ply.find("end_header\n") + 11;
  ASSERT_EQ(ply.size() - body, count * 15);
  float position[3];
  std::memcpy(position, ply.data() + body + 3 * 15, sizeof(position));  // point 3 lies at (30, 0, 0) m
  const Eigen::Vector3d world = flight.WorldFromSubmap(0) * Eigen::Vector3d(position[0], position[1], position[2]);
  EXPECT_LT((world - Eigen::Vector3d(30, 0, 0)).norm(), 1e-4);
  EXPECT_EQ(ply[body + 3 * 15 + 12], 30);
  EXPECT_EQ(static_cast<unsigned char>(ply[body + 3 * 15 + 14]), 200);
  // 19 steps of 8 path points and the last frame, for each of two submaps; it begins at the root's origin.
  const std::string path = Read("cameras.ply");
  EXPECT_THAT(path, HasSubstr("element vertex " + std::to_string(2 * (19 * 8 + 1)) + "\n"));
  std::memcpy(position, path.data() + path.find("end_header\n") + 11, sizeof(position));
  EXPECT_LT(Eigen::Vector3f(position[0], position[1], position[2]).norm(), 1e-6);
}

TEST_F(ExporterTest, ReportIsRebuiltWithWhatTheLauncherAdds) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  ExportAll(model, nullptr, dir_.string());
  EXPECT_THAT(Read("report.html"), Not(HasSubstr("wall time")));
  auto summary = Summary();
  summary["wall_s"] = 12.34;
  summary["frontend"] = {{"track_ms_median", 7.25}, {"track_ms_p95", 11.5}};
  summary["processes"] = {{{"name", "merger"}, {"cpu_s", 3.5}, {"peak_rss_mb", 120.0}}};
  WriteFile((dir_ / "summary.json").string(), summary.dump());
  RebuildReport(dir_.string());
  const std::string report = Read("report.html");
  EXPECT_THAT(report, HasSubstr("12.3 s"));
  EXPECT_THAT(report, HasSubstr("7.2 ms"));
  EXPECT_THAT(
      report,
      HasSubstr(">merger</td><td data-label=\"CPU time\">3.5 s</td><td data-label=\"Peak memory\">120 MB</td>"));
}

TEST_F(ExporterTest, ReportStandsAloneAndEscapesWhatItQuotes) {
  TestFlightOptions options;
  options.num_submaps = 4;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  ExportAll(model, nullptr, dir_.string());
  const std::string report = Read("report.html");
  EXPECT_THAT(report, HasSubstr("The map is in one piece"));
  EXPECT_THAT(report, HasSubstr("only 7 inliers &lt;20 needed&gt; &amp; they lie"));
  EXPECT_THAT(report, HasSubstr("<svg "));
  for (const char* external : {"<script", "<link", "src=", "@import", "url("}) {
    EXPECT_THAT(report, Not(HasSubstr(external)));
  }
}

TEST_F(ExporterTest, FilesOfPartsThatNoLongerExistAreRemoved) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  ExportAll(model, nullptr, dir_.string());  // before the merge: two parts
  EXPECT_TRUE(fs::exists(dir_ / "components/1/frames.tum"));
  WriteFile((dir_ / "components/notes.txt").string(), "mine");
  model.SetRevision(flight.Revision());
  ExportAll(model, nullptr, dir_.string());
  EXPECT_FALSE(fs::exists(dir_ / "components/1"));
  EXPECT_TRUE(fs::exists(dir_ / "components/notes.txt"));
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(dir_)) {
    EXPECT_THAT(entry.path().string(), Not(HasSubstr(".tmp")));
  }
}

TEST_F(ExporterTest, AFlightWithoutAnySubmapIsReported) {
  TestFlightOptions options;
  options.num_submaps = 0;
  ExportAll(MakeModel(TestFlight(options)), nullptr, dir_.string());
  EXPECT_THAT(Read("report.html"), HasSubstr("There is no map"));
  EXPECT_EQ(Summary()["frames_tracked"], 0);
  EXPECT_TRUE(fs::exists(dir_ / "frames.tum"));
}

TEST_F(ExporterTest, OneExportThatCannotBeWrittenDoesNotEndTheOthers) {
  fs::create_directories(dir_);
  WriteFile((dir_ / "colmap").string(), "where a folder is wanted");
  const std::vector<std::string> problems =
      ExportAll(MakeModel(TestFlight(TestFlightOptions())), nullptr, dir_.string());
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_THAT(problems.front(), HasSubstr((dir_ / "colmap").string()));
  for (const char* file : {"frames.tum", "map.ply", "graph.svg", "summary.json", "report.html"})
    EXPECT_TRUE(fs::exists(dir_ / file)) << file;
}

TEST_F(ExporterTest, AnUnusableDirectoryIsOneClearLine) {
  WriteFile(dir_.string(), "a file");
  try {
    PrepareDirectory((dir_ / "out").string());
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("cannot create the directory " + (dir_ / "out").string()));
    EXPECT_THAT(e.what(), Not(HasSubstr("\n")));
  }
  EXPECT_THROW(PrepareDirectory(dir_.string()), std::runtime_error);
  EXPECT_THROW(RebuildReport((dir_ / "nowhere").string()), std::runtime_error);
}

TEST(GraphDotTest, NamesEverySubmapAndConnection) {
  TestFlightOptions options;
  options.num_submaps = 5;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  const std::string dot = MakeGraphDot(MakeSnapshot(model));
  EXPECT_THAT(dot, HasSubstr("graph mapmend {"));
  EXPECT_THAT(dot, HasSubstr("s0 -- s1"));
  EXPECT_THAT(dot, HasSubstr("label=\"F 9  M 340  θ 15.5°\\nC 67.0\", style=bold"));
  EXPECT_THAT(
      dot, HasSubstr(
               "s0 -- s3 [tooltip=\"only 7 inliers <20 needed> & they lie in one corner of the image\", style=dashed"));
}

TEST(GraphSvgTest, LabelsNeverOverlap) {
  for (const int num_submaps : {0, 1, 2, 5, 30}) {
    TestFlightOptions options;
    options.num_submaps = num_submaps;
    options.frames_per_submap = 4;
    const TestFlight flight(options);
    MapModel model = MakeModel(flight);
    model.SetRevision(flight.Revision());
    const std::string svg = MakeGraphSvg(MakeSnapshot(model));
    EXPECT_THAT(svg, HasSubstr("</svg>"));
    std::vector<std::pair<double, double>> labels;  // top left of every label plate
    for (size_t at = svg.find("width=\"150\" height=\"36\""); at != std::string::npos;
         at = svg.find("width=\"150\" height=\"36\"", at + 1)) {
      const size_t start = svg.rfind("<rect", at);
      double x = 0, y = 0;
      ASSERT_EQ(std::sscanf(svg.c_str() + start, "<rect x=\"%lf\" y=\"%lf\"", &x, &y), 2);
      for (const auto& [u, v] : labels) EXPECT_TRUE(std::abs(x - u) >= 150 || std::abs(y - v) >= 36);
      labels.emplace_back(x, y);
    }
    EXPECT_GE(static_cast<int>(labels.size()), num_submaps - 1) << "each edge of the tree has its label";
  }
}

}  // namespace exporter_test
}  // namespace mapmend

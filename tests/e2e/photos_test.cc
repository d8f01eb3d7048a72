// Photos from which nobody has a calibration, and a map of them that other programs take: the frames of the bundled
// flight as a folder of JPEGs whose EXIF tells a focal length that is wrong by 5 %.

#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "libs/geometry/alignment.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/read_trajectory.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace photos_test {

namespace fs = std::filesystem;
using Json = nlohmann::json;

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
constexpr double kFocalLength = 478.25;  // of the flight's calibration, pixels

void MakePhotos(const std::string& folder) {
  fs::create_directory(folder);
  const CommandResult made = RunCommand({"/usr/bin/ffmpeg", "-loglevel", "error", "-i", kFlight + "video.mp4", "-vsync",
                                         "0", "-q:v", "2", folder + "/photo%03d.jpg"},
                                        kPatienceS);
  ASSERT_EQ(made.exit_code, 0) << made.output;
  fs::copy_file(kFlight + "times.txt", folder + "/times.txt");
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".jpg") continue;
    const auto image = Exiv2::ImageFactory::open(entry.path().string());
    image->readMetadata();
    image->exifData()["Exif.Photo.FocalLength"] = "361/100";
    // Pixels per mm of a photo of 800 pixels, such that 3.61 mm are 1.05 times too many.
    const int resolution = static_cast<int>(std::lround(1.05 * kFocalLength / 3.61 * 1000));
    image->exifData()["Exif.Photo.FocalPlaneXResolution"] = std::to_string(resolution) + "/1000";
    image->exifData()["Exif.Photo.FocalPlaneResolutionUnit"] = uint16_t{4};
    image->writeMetadata();
  }
}

class Photos : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    MakePhotos(*folder_ / "photos");
    run_ = RunCommand({kProgram, "run", *folder_ / "photos", "--skip-frames", "74-83", "--groundtruth",
                       kFlight + "groundtruth.tum", "--out", Out(), "--seed", "1", "--port", "0", "--frame", "level",
                       "--format", "las,g2o,gltf,mcap,kitti", "--format", "euroc"},
                      kPatienceS);
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string Out() { return *folder_ / "out"; }
  static Json Summary() { return Json::parse(ReadText(Out() + "/summary.json")); }

  static std::unique_ptr<TemporaryFolder> folder_;
  static CommandResult run_;
};

std::unique_ptr<TemporaryFolder> Photos::folder_;
CommandResult Photos::run_;

TEST_F(Photos, AreMappedWithTheCameraThatTheyTell) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  EXPECT_NE(run_.output.find("camera guessed from EXIF: focal length 502 px of 800 x 600: 3.61 mm"), std::string::npos)
      << run_.output;
  EXPECT_NE(run_.output.find("a calibration is better"), std::string::npos);
  EXPECT_NEAR(ReadCamera(Out() + "/camera.yaml").fx, 1.05 * kFocalLength, 0.1);
  EXPECT_EQ(Summary().at("components").size(), 1u);
  EXPECT_GE(Summary().at("frames_in_main").get<int>(), 162 * 95 / 100);
}

TEST_F(Photos, TheLevelFrameHasTheVerticalOfTheWorld) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  EXPECT_EQ(Summary().at("frame"), "level");
  EXPECT_EQ(Summary().at("unit"), "map units");
  const Trajectory frames = ReadTrajectory(Out() + "/frames.tum");
  const Evaluation evaluation =
      EvaluateTrajectory(frames, ReadTrajectory(kFlight + "groundtruth.tum"), EvaluationOptions());
  ASSERT_TRUE(evaluation.success) << evaluation.reason;
  const Eigen::Vector3d up = evaluation.reference_from_estimate.rotation * Eigen::Vector3d::UnitZ();
  EXPECT_GT(up.z(), std::cos(3 * M_PI / 180)) << up.transpose();
  for (const StampedPose& pose : frames) EXPECT_GT(pose.world_from_camera.translation.z(), 0) << "above the ground";
}

TEST_F(Photos, TrajectoriesOfOtherFormatsAreTheSame) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  const Trajectory frames = ReadTrajectory(Out() + "/frames.tum");
  std::vector<int64_t> times;
  for (const StampedPose& pose : frames) times.push_back(pose.utime);
  for (const Trajectory& other : {ReadTrajectoryFile(Out() + "/frames.kitti.txt", times).poses,
                                  ReadTrajectoryFile(Out() + "/frames.euroc.csv").poses}) {
    ASSERT_EQ(other.size(), frames.size());
    for (size_t i = 0; i < frames.size(); ++i) {
      EXPECT_EQ(other[i].utime, frames[i].utime);
      EXPECT_LT((other[i].world_from_camera.translation - frames[i].world_from_camera.translation).norm(), 1e-6);
    }
  }
}

// What was measured and what was made of it agree to a few of the standard deviations that are told.
TEST_F(Photos, ThePoseGraphJoinsTheSubmaps) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  std::istringstream lines(ReadText(Out() + "/graph.g2o"));
  std::vector<Rigid3> vertices;
  std::string part;
  std::map<std::string, std::vector<double>> errors;  // by part, sigma
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string tag;
    int a = 0, b = 0;
    std::array<double, 7> v;
    words >> tag;
    if (tag == "#") part = line;
    if (tag == "VERTEX_SE3:QUAT") {
      words >> a;
      for (double& x : v) words >> x;
      vertices.push_back(RigidFromArray(v.data()));
    }
    if (tag != "EDGE_SE3:QUAT") continue;
    words >> a >> b;
    for (double& x : v) words >> x;
    double information = 0;
    words >> information;
    const Rigid3 error = RigidFromArray(v.data()).Inverse() * vertices.at(a).Inverse() * vertices.at(b);
    errors[part].push_back(error.translation.norm() * std::sqrt(information));
  }
  EXPECT_EQ(vertices.size(), Summary().at("keyframes_in_main").get<size_t>());
  ASSERT_TRUE(errors.contains("# as tracked") && errors.contains("# tree"));
  EXPECT_GT(errors["# as tracked"].size(), vertices.size());
  for (auto& [name, list] : errors) {
    std::sort(list.begin(), list.end());
    EXPECT_LT(list[list.size() / 2], 6) << name;
  }
}

TEST_F(Photos, FilesForOtherProgramsAreThere) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  EXPECT_EQ(fs::file_size(Out() + "/map.las"), 375 + 36 * Summary().at("points_in_main").get<size_t>());
  EXPECT_EQ(ReadText(Out() + "/map.glb").substr(0, 4), "glTF");
  EXPECT_EQ(ReadText(Out() + "/map.mcap").substr(1, 4), "MCAP");
}

TEST_F(Photos, AFlightThatTurnsAndTiltsTellsItsFocalLength) {
  ASSERT_EQ(run_.exit_code, 0) << run_.output;
  const CommandResult result = RunCommand({kProgram, "calibrate", Out(), "--json"}, kPatienceS);
  ASSERT_EQ(result.exit_code, 0) << result.output;
  const Json told = Json::parse(result.output);
  const double focal_length = told.at("focal_length_px");
  EXPECT_NEAR(focal_length, kFocalLength, 0.01 * kFocalLength) << result.output;
  EXPECT_LT(told.at("focal_length_sigma_px").get<double>(), 0.02 * focal_length);
  EXPECT_LT(told.at("error_px"), told.at("error_before_px"));
  const Camera camera = ReadCamera(Out() + "/calibrated_camera.yaml");
  EXPECT_NEAR(camera.fx, focal_length, 1e-6);
  EXPECT_EQ(camera.width, 800);
}

}  // namespace photos_test
}  // namespace mapmend

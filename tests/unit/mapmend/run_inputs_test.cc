#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "libs/geometry/camera.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/run_options.h"

namespace mapmend {
namespace run_inputs_test {

namespace fs = std::filesystem;

// Runs body, which must throw, and returns what it says.
template <typename Body>
std::string Message(Body body) {
  try {
    body();
  } catch (const std::exception& e) {
    return e.what();
  }
  return "(no error)";
}

// A socket that listens on a port of its own, and says nothing to whoever connects.
class SilentServer {
 public:
  SilentServer() {
    fd_ = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    listen(fd_, 4);
    socklen_t size = sizeof(address);
    getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  ~SilentServer() { Close(); }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }
  int Port() const { return port_; }

 private:
  int fd_ = -1, port_ = 0;
};

class RunInputsTest : public testing::Test {
 protected:
  RunInputsTest() {
    folder_ = fs::path(testing::TempDir()) / ("run_inputs_" + std::to_string(getpid()));
    fs::create_directories(folder_);
    options_.inputs = {flight_ + "/video.mp4"};
    options_.camera = flight_ + "/camera.yaml";
    options_.times = flight_ + "/times.txt";
  }
  ~RunInputsTest() override { fs::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& content) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << content;
    return path;
  }
  std::string Error() {
    return Message([&] { CheckRunInputs(options_); });
  }

  const std::string flight_ = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross";
  fs::path folder_;
  RunOptions options_;
};

TEST_F(RunInputsTest, NamesWhatIsMissing) {
  options_.inputs = {"/no/such/video.mp4"};
  EXPECT_EQ(Error(), "input /no/such/video.mp4 does not exist");
  options_.inputs = {folder_.string()};
  EXPECT_EQ(Error(), "input folder " + folder_.string() + " holds no images (jpg, png, bmp, tif, pgm, ppm, webp)");
  options_.inputs = {Write("noise.mp4", "this is no video")};
  EXPECT_EQ(Error(),
            "input " + options_.inputs[0] +
                " cannot be opened as a video: unknown format, or cut short (an mp4 has its index at its end)");
}

TEST_F(RunInputsTest, NamesTheKeyOfTheCameraFile) {
  options_.camera = Write("camera.yaml", "Camera.fx: 478\nCamera.cx: 400\nCamera.cy: 300\n");
  EXPECT_EQ(Error(), "camera file " + options_.camera + ": key Camera.fy is missing (ORB-SLAM settings)");
}

std::string CameraText(double f, double cx, double cy, const std::string& more) {
  char text[300];
  std::snprintf(text, sizeof(text), "Camera.fx: %g\nCamera.fy: %g\nCamera.cx: %g\nCamera.cy: %g\n", f, f, cx, cy);
  return text + more;
}

TEST_F(RunInputsTest, WithoutACameraFilePhotosAreAskedAndElseTheErrorSaysHow) {
  const std::string photo = (folder_ / "a.jpg").string();
  cv::imwrite(photo, cv::Mat(300, 400, CV_8UC1, cv::Scalar(90)));
  options_.inputs = {folder_.string()};
  options_.camera.clear();
  options_.times.clear();
  options_.out = (folder_ / "out").string();
  EXPECT_EQ(
      Error(),
      "no camera file: give one with --camera (there is no camera.yaml beside the input either); data/cameras has "
      "examples, and its README says how to make one");
  const auto image = Exiv2::ImageFactory::open(photo);
  image->readMetadata();
  image->exifData()["Exif.Image.Model"] = "FC300X";
  image->writeMetadata();
  EXPECT_NE(Error().find("and the EXIF of a.jpg does not tell a focal length"), std::string::npos) << Error();
  image->exifData()["Exif.Photo.FocalLength"] = "361/100";
  image->writeMetadata();
  const RunInputs inputs = CheckRunInputs(options_);
  EXPECT_EQ(inputs.options.camera, options_.out + "/camera.yaml");
  EXPECT_FALSE(fs::exists(options_.out)) << "nothing is written yet";
  EXPECT_NEAR(ReadCamera(Write("guessed.yaml", inputs.guessed_camera)).fx, 3.61 / 6.17 * 400, 1e-6);
  EXPECT_NE(inputs.notes.front().find("guessed from EXIF"), std::string::npos) << inputs.notes.front();
  Write("camera.yaml", CameraText(300, 199.5, 149.5, ""));
  EXPECT_EQ(CheckRunInputs(options_).options.camera, (folder_ / "camera.yaml").string()) << "a file counts more";
}

// The images of the flight have 800 x 600 pixels.
TEST_F(RunInputsTest, TheCameraFileMustMeanTheseImages) {
  options_.camera = Write("camera.yaml", CameraText(2391.25, 1999.5, 1499.5, ""));
  EXPECT_NE(Error().find("its principal point"), std::string::npos) << Error();
  options_.camera = Write("camera.yaml", CameraText(0.6, 0.5, 0.5, ""));
  EXPECT_NE(Error().find("normalised"), std::string::npos) << Error();
  options_.camera = Write("camera.yaml", CameraText(900, 959.5, 539.5, "Camera.cols: 1920\nCamera.rows: 1080\n"));
  EXPECT_NE(Error().find("the images have 800 x 600 pixels, the camera file says 1920 x 1080"), std::string::npos);
  options_.camera = Write("camera.yaml", CameraText(2391.25, 1999.5, 1499.5, "Camera.cols: 4000\nCamera.rows: 3000\n"));
  const RunInputs inputs = CheckRunInputs(options_);
  ASSERT_EQ(inputs.notes.size(), 1u);
  EXPECT_NE(inputs.notes[0].find("the calibration is scaled"), std::string::npos) << inputs.notes[0];
}

TEST_F(RunInputsTest, AMaskIsReadBeforeAnythingStarts) {
  options_.mask = Write("mask.yaml", "mask_rectangles: [[0, 1, 0, 0.1]]\n");
  EXPECT_TRUE(CheckRunInputs(options_).notes.empty());
  options_.mask = Write("mask.yaml", "mask_rectangles: [[0, 1, 0, 1]]\n");
  EXPECT_NE(Error().find("mask " + options_.mask + ": covers the whole image"), std::string::npos) << Error();
}

TEST_F(RunInputsTest, GroundTruthIsReadBeforeAnythingStarts) {
  options_.groundtruth = Write("gt.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_NE(Error().find("1 poses for 172 times"), std::string::npos) << Error();
  options_.groundtruth = Write("gt.txt", "1525003606.0 0 0 70\n1525003612.0 nan nan nan\n");
  const RunInputs inputs = CheckRunInputs(options_);
  ASSERT_EQ(inputs.notes.size(), 1u);
  EXPECT_NE(inputs.notes[0].find("1 line that is not a number left out"), std::string::npos) << inputs.notes[0];
  options_.groundtruth.clear();
  options_.time_offset = 5;
  EXPECT_NE(Error().find("need --groundtruth"), std::string::npos) << Error();
}

TEST_F(RunInputsTest, WantsATimeForEachFrame) {
  options_.times = Write("times.txt", "# seconds\n1.0\n2.0\n");
  EXPECT_EQ(Error(), "times file " + options_.times + " has 2 lines for 172 frames; it needs one for each");
  options_.times = Write("times.txt", "1.0\nsoon\n");
  EXPECT_EQ(Error(), "times file " + options_.times + ", line 2: \"soon\" is not a time");
}

TEST_F(RunInputsTest, NamesAVocabularyThatIsNone) {
  options_.vocabulary = Write("words.voc", "no vocabulary");
  EXPECT_NE(Error().find(options_.vocabulary), std::string::npos) << Error();
}

TEST(OutFolder, RefusesAnEarlierMapAndRemovesOnlyResults) {
  const fs::path folder = fs::path(testing::TempDir()) / ("out_folder_" + std::to_string(getpid()));
  fs::create_directories(folder / "submaps/0");
  std::ofstream(folder / "map.db") << "x";
  std::ofstream(folder / "notes.txt") << "mine";
  EXPECT_NE(Message([&] { OutFolder(folder.string(), false, false); }).find("already holds a map.db"),
            std::string::npos);
  EXPECT_TRUE(fs::exists(folder / "map.db"));
  {
    const OutFolder appended(folder.string(), false, true);
    EXPECT_TRUE(fs::exists(folder / "map.db"));
  }
  const OutFolder replaced(folder.string(), true, false);
  EXPECT_FALSE(fs::exists(folder / "map.db"));
  EXPECT_FALSE(fs::exists(folder / "submaps"));
  EXPECT_TRUE(fs::exists(folder / "notes.txt"));
  EXPECT_TRUE(fs::exists(folder / "logs"));
  EXPECT_EQ(Message([&] { OutFolder(folder.string(), true, false); }),
            "another mapmend is writing into " + folder.string() + "; choose another --out");
  fs::remove_all(folder);
}

TEST(OutFolder, NamesAFolderThatCannotBeMade) {
  EXPECT_EQ(
      Message([&] { OutFolder("/proc/mapmend", false, false); }).rfind("cannot write to --out /proc/mapmend: ", 0), 0u);
}

TEST(FreePort, NamesTheOptionOfAPortInUse) {
  SilentServer server;
  EXPECT_EQ(Message([&] { FreePort(server.Port(), true, "--port"); }),
            "--port " + std::to_string(server.Port()) + ": the port is in use by another program; choose another");
  EXPECT_NE(FreePort(server.Port(), false, "--port").Port(), server.Port());
  server.Close();
  EXPECT_EQ(FreePort(server.Port(), true, "--port").Port(), server.Port());
}

TEST(FreePort, IsKeptFromOthers) {
  const FreePort first(28080, false, "--port"), second(28080, false, "--port");
  EXPECT_NE(first.Port(), second.Port());
}

TEST(PlanBus, BringsAHubOnlyWhereNoneAnswers) {
  EXPECT_TRUE(PlanBus("").start_hub);
  EXPECT_FALSE(PlanBus("udpm://239.255.76.67:7667?ttl=0").start_hub);
  SilentServer server;
  const std::string url = "tcpq://127.0.0.1:" + std::to_string(server.Port());
  EXPECT_NE(Message([&] { PlanBus(url); }).find("is in use by a program that is not an LCM hub"), std::string::npos);
  server.Close();
  const BusPlan plan = PlanBus(url);
  EXPECT_TRUE(plan.start_hub);
  EXPECT_EQ(plan.hub_port, server.Port());
  for (const char* wrong : {"tcpq://", "tcpq://127.0.0.1", "tcpq://127.0.0.1:0", "tcpq://127.0.0.1:70000",
                            "tcpq://:7700", "memq://", "x"}) {
    EXPECT_NE(Message([&] { PlanBus(wrong); }).find("expected tcpq://HOST:PORT"), std::string::npos) << wrong;
  }
}

}  // namespace run_inputs_test
}  // namespace mapmend

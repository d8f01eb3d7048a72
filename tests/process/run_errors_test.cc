// What `mapmend run` says and leaves behind when something is wrong: one clear line, an exit code, no process.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/videoio.hpp>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace run_errors_test {

const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// Binds a port of this host for as long as it lives.
class BoundPort {
 public:
  BoundPort() : fd_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address));
    listen(fd_, 4);
    socklen_t size = sizeof(address);
    getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = std::to_string(ntohs(address.sin_port));
  }
  ~BoundPort() { close(fd_); }
  const std::string& Port() const { return port_; }

 private:
  int fd_;
  std::string port_;
};

class RunErrorsTest : public testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& content) {
    std::ofstream(folder_ / name, std::ios::binary) << content;
    return folder_ / name;
  }
  // Runs on the bundled flight unless told otherwise.
  CommandResult Run(const std::vector<std::string>& options, const std::string& input = kFlight + "video.mp4") {
    std::vector<std::string> argv = {kProgram, "run", input};
    argv.insert(argv.end(), options.begin(), options.end());
    const auto add_default = [&](const std::string& name, const std::string& value) {
      if (std::find(options.begin(), options.end(), name) == options.end()) argv.insert(argv.end(), {name, value});
    };
    add_default("--camera", kFlight + "camera.yaml");
    add_default("--times", kFlight + "times.txt");
    add_default("--out", folder_ / "out");
    add_default("--port", "0");
    add_default("--mosaic", "none");
    return RunCommand(argv);
  }
  // Exactly one line, and this one.
  static void ExpectError(const CommandResult& result, const std::string& line) {
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.output, "mapmend: " + line + "\n");
  }
  // A vocabulary of two words, in DBoW2's text format.
  std::string TinyVocabulary() {
    std::string zeros, ones;
    for (int i = 0; i < 32; ++i) zeros += "0 ", ones += "255 ";
    return Write("tiny.txt", "2 1 0 0\n0 1 " + zeros + "0.5\n0 1 " + ones + "0.5\n");
  }

  TemporaryFolder folder_;
};

TEST_F(RunErrorsTest, MissingInput) {
  ExpectError(Run({}, "/no/such/video.mp4"), "input /no/such/video.mp4 does not exist");
}

TEST_F(RunErrorsTest, CameraFileWithoutAKey) {
  const std::string camera = Write("camera.yaml", "Camera.fx: 478\nCamera.fy: 478\nCamera.cy: 300\n");
  ExpectError(Run({"--camera", camera}), "camera file " + camera + ": key Camera.cx is missing (ORB-SLAM settings)");
}

TEST_F(RunErrorsTest, EmptyFolder) {
  std::filesystem::create_directory(folder_ / "images");
  ExpectError(Run({}, folder_ / "images"),
              "input folder " + (folder_ / "images") + " holds no images (jpg, png, bmp, tif, pgm, ppm, webp)");
}

TEST_F(RunErrorsTest, OutFolderThatCannotBeWritten) {
  const std::string file = Write("file", "");
  const CommandResult result = Run({"--out", file + "/out"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.output, "mapmend: cannot write to --out " + file + "/out: Not a directory\n");
}

TEST_F(RunErrorsTest, PortInUse) {
  const BoundPort bound;
  ExpectError(Run({"--port", bound.Port()}),
              "--port " + bound.Port() + ": the port is in use by another program; choose another");
  const std::string url = "tcpq://127.0.0.1:" + bound.Port();
  ExpectError(Run({"--lcm-url", url}), "--lcm-url " + url + ": port " + bound.Port() +
                                           " is in use by a program that is not an LCM hub; choose another port");
}

TEST_F(RunErrorsTest, MalformedSkipFrames) {
  ExpectError(Run({"--skip-frames", "80-12"}), "--skip-frames 80-12: expected ranges of frames, e.g. 80-120,200-240");
}

TEST_F(RunErrorsTest, DatabaseOfAnEarlierRunAndOfAnotherVocabulary) {
  // A few frames are enough to make a map. (Without a keyframe it would be none.)
  ASSERT_NE(Run({"--skip-frames", "24-171"}).exit_code, 1);
  const std::string out = folder_ / "out";
  ExpectError(Run({}), out +
                           " already holds a map.db: give another --out, --overwrite to replace it, or --append to map "
                           "this flight into it");
  const CommandResult result = Run({"--append", "--vocabulary", TinyVocabulary()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.output.rfind("mapmend: submap_store: " + out + "/map.db: session ", 0), 0u) << result.output;
  EXPECT_NE(result.output.find("was made with vocabulary "), std::string::npos) << result.output;
  EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
}

TEST_F(RunErrorsTest, ARunThatFailedBeforeItsFirstKeyframeDoesNotBlockTheNext) {
  // The camera file of another camera: told when the first image is read, at the latest.
  std::string text = ReadText(kFlight + "camera.yaml");
  const size_t at = text.find("800");
  ASSERT_NE(at, std::string::npos);
  const std::string wrong = Write("wrong.yaml", text.replace(at, 3, "640"));
  EXPECT_EQ(Run({"--camera", wrong, "--skip-frames", "3-171"}).exit_code, 1);
  const CommandResult result = Run({"--skip-frames", "12-171"});
  EXPECT_TRUE(result.exit_code == 0 || result.exit_code == 4) << result.output;
  EXPECT_EQ(result.output.find("already holds"), std::string::npos) << result.output;
}

TEST_F(RunErrorsTest, VideoThatEndsInMidFileIsMappedAsFarAsItGoes) {
  // The first frames of the flight as motion JPEG: an AVI file tells their number at its head.
  cv::VideoCapture flight(kFlight + "video.mp4");
  cv::VideoWriter writer(folder_ / "cut.avi", cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 1,
                         cv::Size(800, 600));
  cv::Mat image;
  for (int i = 0; i < 24 && flight.read(image); ++i) writer.write(image);
  writer.release();
  const std::string cut = folder_ / "cut.avi";
  std::filesystem::resize_file(cut, std::filesystem::file_size(cut) / 2);

  const CommandResult result = Run({}, cut);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.output.find("mapmend: frontend: input " + cut + ": ends after "), std::string::npos)
      << result.output;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/report.html"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/frames.tum"));
}

TEST_F(RunErrorsTest, VideoWithoutItsIndex) {
  const std::string video = ReadText(kFlight + "video.mp4");
  const std::string cut = Write("cut.mp4", video.substr(0, video.size() / 2));
  ExpectError(
      Run({}, cut),
      "input " + cut + " cannot be opened as a video: unknown format, or cut short (an mp4 has its index at its end)");
}

}  // namespace run_errors_test
}  // namespace mapmend

// Cameras that the frontend reads itself: a folder that grows, a stream from a network.

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "libs/capture/device_images.h"
#include "libs/capture/follow_folder.h"
#include "tests/scratch_folder.h"
#include "tests/unit/capture/make_video.h"

namespace mapmend {
namespace live_sources_test {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

std::vector<uint8_t> Jpeg(int value, int width = 64, int height = 48) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(height, width, CV_8UC1, cv::Scalar(value)), bytes);
  return bytes;
}

void Write(const std::string& path, const std::vector<uint8_t>& bytes, size_t begin, size_t end) {
  std::ofstream file(path, std::ios::binary | (begin > 0 ? std::ios::app : std::ios::trunc));
  file.write(reinterpret_cast<const char*>(bytes.data()) + begin, static_cast<long>(end - begin));
}

TEST(FollowFolder, GivesWhatIsThereThenWhatComesUntilItIsStopped) {
  const ScratchFolder folder;
  const auto put = [&](int number, int width = 64) {
    const auto bytes = Jpeg(number, width);
    Write(folder.File(cv::format("f%d.jpg", number)), bytes, 0, bytes.size());
  };
  for (const int number : {2, 10, 9}) put(number);
  FollowFolder source(folder.Path(), 64, 48);
  std::thread camera([&] {
    std::this_thread::sleep_for(milliseconds(200));
    put(11, 32);  // of another size
    // A file that is written slowly is not taken before it is whole.
    const auto bytes = Jpeg(12);
    Write(folder.File("f12.jpg"), bytes, 0, bytes.size() / 2);
    std::this_thread::sleep_for(milliseconds(500));
    Write(folder.File("f12.jpg"), bytes, bytes.size() / 2, bytes.size());
    put(13);
  });
  int64_t last_utime = 0;
  for (const int number : {2, 9, 10, 12, 13}) {
    const auto image = source.Next();
    ASSERT_TRUE(image);
    EXPECT_NEAR(image->pixels->at<uint8_t>(0, 0), number, 1);
    EXPECT_GT(image->utime, last_utime);
    last_utime = image->utime;
  }
  camera.join();
  EXPECT_EQ(source.NumBad(), 1);
  EXPECT_NE(source.LastProblem().find("f11.jpg has 32 x 48 pixels"), std::string::npos) << source.LastProblem();
  std::thread stopper([&] {
    std::this_thread::sleep_for(milliseconds(150));
    source.Stop();
  });
  EXPECT_FALSE(source.Next());
  stopper.join();
  EXPECT_THROW(FollowFolder("/no/such/folder", 64, 48), std::runtime_error);
}

TEST(FollowFolder, AFileThatStaysDamagedIsLeftOut) {
  const ScratchFolder folder;
  const auto bytes = Jpeg(1);
  Write(folder.File("f1.jpg"), bytes, 0, bytes.size() / 2);
  Write(folder.File("f2.jpg"), bytes, 0, bytes.size());
  FollowFolder source(folder.Path(), 64, 48);
  const auto image = source.Next();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->index, 1);
  EXPECT_NE(source.LastProblem().find("f1.jpg is cut short"), std::string::npos) << source.LastProblem();
}

int FreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  bind(fd, reinterpret_cast<sockaddr*>(&address), length);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  close(fd);
  return ntohs(address.sin_port);
}

// ffmpeg as a camera on a network: sends 20 frames to whoever connects first, then is gone.
class NetworkCamera {
 public:
  explicit NetworkCamera(const std::string& url) {
    pid_ = fork();
    if (pid_ == 0) {
      const std::string to = url + "?listen=1";
      execlp("ffmpeg", "ffmpeg", "-v", "quiet", "-nostdin", "-re", "-f", "lavfi", "-i",
             "testsrc2=s=160x120:r=20:d=1.01", "-c:v", "mpeg2video", "-f", "mpegts", to.c_str(), nullptr);
      _exit(127);
    }
  }
  ~NetworkCamera() {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_;
};

TEST(DeviceImages, ACameraThatGoesAwayIsWaitedForAndItsTimesGrow) {
  const std::string url = "tcp://127.0.0.1:" + std::to_string(FreePort());
  std::mutex mutex;
  std::vector<std::string> lines;
  DeviceImages source(url, 160, 120, 1000, [&](const std::string& line) {
    const std::lock_guard lock(mutex);
    lines.push_back(line);
  });
  std::this_thread::sleep_for(milliseconds(300));  // nobody there
  int64_t last_utime = 0;
  int index = 0;
  for (int life = 0; life < 2; ++life) {
    const NetworkCamera camera(url);
    for (int i = 0; i < 12; ++i) {
      const auto image = source.Next();
      ASSERT_TRUE(image);
      EXPECT_EQ(image->index, index++);
      EXPECT_EQ(image->pixels->cols, 160);
      EXPECT_GT(image->utime, last_utime);
      last_utime = image->utime;
    }
  }
  source.Stop();
  EXPECT_FALSE(source.Next());
  const std::lock_guard lock(mutex);
  ASSERT_GE(lines.size(), 3u);
  EXPECT_NE(lines[0].find("cannot be opened"), std::string::npos) << lines[0];
  EXPECT_NE(lines[1].find("images of 160 x 120 pixels come"), std::string::npos) << lines[1];
}

TEST(DeviceImages, SourcesThatAreNoneAreToldAndWaitedFor) {
  for (const char* name : {"/dev/video77", "gst:nosuchelement", "rtsp://127.0.0.1:1/x"}) {
    EXPECT_TRUE(DeviceImages::IsDevice(name));
    DeviceImages source(name, 160, 120, 3, [](const std::string&) {});
    for (int i = 0; i < 200 && source.News().empty(); ++i) std::this_thread::sleep_for(milliseconds(50));
    EXPECT_NE(source.News().find(cv::format("source %s cannot be opened", name)), std::string::npos) << source.News();
  }
  EXPECT_FALSE(DeviceImages::IsDevice("images"));
}

TEST(DeviceImages, APipelineOfGStreamer) {
  if (std::system("gst-inspect-1.0 videotestsrc videoconvert >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "the elements of GStreamer are not installed";
  DeviceImages source("gst:videotestsrc num-buffers=5 ! video/x-raw,width=160,height=120", 160, 120, 100,
                      [](const std::string&) {});
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(source.Next());
}

}  // namespace live_sources_test
}  // namespace mapmend

#include "tools/simulate/frame_writer.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

extern char** environ;

namespace mapmend::simulate {
namespace {

namespace fs = std::filesystem;

cv::Mat View(const Frame& frame) {
  return {frame.height, frame.width, CV_8UC3, const_cast<uint8_t*>(frame.bgr.data())};
}

class VideoWriter : public FrameWriter {
 public:
  VideoWriter(const std::string& dir, int width, int height, double fps, int crf)
      : final_(dir + "/video.mp4"), part_(final_ + ".part"), log_(final_ + ".log.part") {
    signal(SIGPIPE, SIG_IGN);  // a dead encoder shows as an error of write()
    char size[32], rate[32];
    std::snprintf(size, sizeof size, "%dx%d", width, height);
    std::snprintf(rate, sizeof rate, "%.6f", fps);
    std::vector<std::string> words = {
        "ffmpeg",   "-nostdin", "-v",      "error",     "-y",        "-f",        "rawvideo",
        "-pix_fmt", "yuv420p",  "-s",      size,        "-r",        rate,        "-i",
        "pipe:0",   "-c:v",     "libx264", "-preset",   "ultrafast", "-crf",      std::to_string(crf),
        "-threads", "2",        "-fflags", "+bitexact", "-flags:v",  "+bitexact", "-f",
        "mp4",      part_};
    std::vector<char*> argv;
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
      throw std::runtime_error(std::string("cannot make a pipe: ") + std::strerror(errno));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], 0);
    posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 2, log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    // A group of its own: Ctrl-C is for this program, which then ends the encoder.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    const int error = posix_spawnp(&child_, "ffmpeg", &actions, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[0]);
    pipe_ = ends[1];
    if (error != 0) {
      close(pipe_);
      throw std::runtime_error(std::string("cannot start ffmpeg, which encodes the video (package ffmpeg): ") +
                               std::strerror(error));
    }
  }
  ~VideoWriter() override {
    if (pipe_ >= 0) close(pipe_);
    if (child_ > 0) {
      kill(child_, SIGKILL);
      waitpid(child_, nullptr, 0);
    }
    std::error_code error;
    fs::remove(part_, error);
    fs::remove(log_, error);
  }
  void Write(const Frame& frame) override {
    cv::cvtColor(View(frame), yuv_, cv::COLOR_BGR2YUV_I420);
    const char* data = reinterpret_cast<const char*>(yuv_.data);
    size_t left = yuv_.total();
    while (left > 0) {
      const ssize_t written = write(pipe_, data, left);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) Fail();
      data += written;
      left -= static_cast<size_t>(written);
    }
  }
  void Finish() override {
    close(pipe_);
    pipe_ = -1;
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) Fail();
    std::error_code error;
    fs::remove(log_, error);
    // ffmpeg does not report a disk that fills up while it writes the index: the file would have no index then.
    std::ifstream file(part_, std::ios::binary);
    const std::string content(std::istreambuf_iterator<char>(file), {});
    if (content.find("moov") == std::string::npos)
      throw std::runtime_error(final_ + ": the video could not be written completely (disk full?)");
    if (std::rename(part_.c_str(), final_.c_str()) != 0) throw std::runtime_error(final_ + ": " + std::strerror(errno));
  }

 private:
  [[noreturn]] void Fail() {
    if (pipe_ >= 0) close(pipe_);
    pipe_ = -1;
    if (child_ > 0) waitpid(child_, nullptr, 0);
    child_ = -1;
    std::ifstream log(log_);
    std::string line;
    std::getline(log, line);
    throw std::runtime_error(final_ +
                             ": the encoder ffmpeg failed: " + (line.empty() ? "no space left on the disk?" : line));
  }

  std::string final_, part_, log_;
  pid_t child_ = -1;
  int pipe_ = -1;
  cv::Mat yuv_;
};

class ImageWriter : public FrameWriter {
 public:
  explicit ImageWriter(const std::string& dir) : final_(dir + "/images"), part_(final_ + ".part") {
    fs::remove_all(part_);
    fs::create_directories(part_);
  }
  ~ImageWriter() override {
    std::error_code error;
    fs::remove_all(part_, error);
  }
  void Write(const Frame& frame) override {
    char name[32];
    std::snprintf(name, sizeof name, "/%06d.png", count_++);
    // Encoded in memory first: on a full disk libpng would print a line of its own.
    std::vector<uint8_t> png;
    cv::imencode(".png", View(frame), png, {cv::IMWRITE_PNG_COMPRESSION, 1});
    std::ofstream file(part_ + name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
    file.close();
    if (!file) {
      throw std::runtime_error(final_ + name + ": cannot be written (disk full?)");
    }
  }
  void Finish() override {
    fs::remove_all(final_);
    fs::rename(part_, final_);
  }

 private:
  std::string final_, part_;
  int count_ = 0;
};

}  // namespace

std::unique_ptr<FrameWriter> FrameWriter::Video(const std::string& dir, int width, int height, double fps, int crf) {
  return std::make_unique<VideoWriter>(dir, width, height, fps, crf);
}
std::unique_ptr<FrameWriter> FrameWriter::Images(const std::string& dir) { return std::make_unique<ImageWriter>(dir); }

}  // namespace mapmend::simulate

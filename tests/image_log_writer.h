#pragma once

#include <bot_core/image_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace mapmend {

// Writes what lcm-logger would have written beside a camera.
class ImageLogWriter {
 public:
  explicit ImageLogWriter(const std::string& path) : log_(path, "w") {
    if (!log_.good()) throw std::runtime_error("cannot write " + path);
  }
  void Add(const std::string& channel, int64_t utime, std::vector<uint8_t> bytes) {
    lcm::LogEvent event{};
    event.timestamp = utime + 2000;  // when it had come through the network
    event.channel = channel;
    event.datalen = static_cast<int32_t>(bytes.size());
    event.data = bytes.data();
    if (log_.writeEvent(&event) != 0) throw std::runtime_error("cannot write an event");
  }
  template <typename Message>
  void AddMessage(const std::string& channel, const Message& message) {
    std::vector<uint8_t> bytes(static_cast<size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    Add(channel, message.utime, std::move(bytes));
  }
  // As JPEG, in mapmend's image_t.
  void AddImage(const std::string& channel, int64_t utime, int frame, const cv::Mat& pixels) {
    image_t message{};
    message.utime = utime;
    message.frame = frame;
    message.format = image_t::JPEG;
    message.width = pixels.cols;
    message.height = pixels.rows;
    cv::imencode(".jpg", pixels, message.data);
    message.num_bytes = static_cast<int32_t>(message.data.size());
    AddMessage(channel, message);
  }
  // 8-bit colours as bot_core's image_t has them, row by row.
  void AddForeignImage(const std::string& channel, int64_t utime, const cv::Mat& pixels) {
    bot_core::image_t message{};
    message.utime = utime;
    message.width = pixels.cols;
    message.height = pixels.rows;
    message.row_stride = static_cast<int32_t>(pixels.step);
    message.pixelformat = 'B' | 'G' << 8 | 'R' << 16 | '3' << 24;
    message.data.assign(pixels.datastart, pixels.dataend);
    message.size = static_cast<int32_t>(message.data.size());
    AddMessage(channel, message);
  }

 private:
  lcm::LogFile log_;
};

// The first images of a video.
inline std::vector<cv::Mat> FirstImages(const std::string& video, int count) {
  cv::VideoCapture reader(video);
  std::vector<cv::Mat> images;
  for (cv::Mat image; static_cast<int>(images.size()) < count && reader.read(image);) images.push_back(image.clone());
  return images;
}

}  // namespace mapmend

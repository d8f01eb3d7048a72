#include "libs/image_messages/image_message.h"

#include <exception>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>

#include "libs/image_messages/foreign_image.h"

namespace mapmend {
namespace {

std::string SizeText(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

// Width and height from a JPEG's frame header (ITU-T T.81, B.2.2); nullopt if there is none.
std::optional<std::pair<int, int>> JpegSize(const std::vector<uint8_t>& bytes) {
  if (bytes.size() < 4 || bytes[0] != 0xFF || bytes[1] != 0xD8) return std::nullopt;
  const auto number = [&](size_t i) { return bytes[i] << 8 | bytes[i + 1]; };
  for (size_t at = 2; at + 9 <= bytes.size();) {
    if (bytes[at] != 0xFF) return std::nullopt;
    const uint8_t marker = bytes[at + 1];
    if (marker == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    if (marker == 0xDA) return std::nullopt;  // pixels begin and no header came
    const bool is_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame) return std::pair(number(at + 7), number(at + 5));
    const int length = number(at + 2);
    if (length < 2) return std::nullopt;
    at += 2 + static_cast<size_t>(length);
  }
  return std::nullopt;
}

}  // namespace

bool DecodeImageMessage(const uint8_t* data, int size, image_t* message) {
  try {
    return message->decode(data, 0, size) == size || DecodeForeignImage(data, size, message);
  } catch (const std::exception&) {  // a size that no memory can hold
    return false;
  }
}

bool IsEndOfStream(const image_t& message) {
  return message.num_bytes == 0 && message.width == 0 && message.height == 0 && message.utime == 0 &&
         message.frame == 0;
}

std::string ImageProblem(const image_t& message, int width, int height) {
  if (message.num_bytes == 0) return "image without a byte";
  if (message.format != image_t::JPEG && message.format != image_t::GREY8 && message.format != image_t::BGR8) {
    return "format " + std::to_string(message.format) +
           " is not known; known are 0 (JPEG), 1 (8-bit grey) and 2 (8-bit blue, green, red)";
  }
  if (message.width != width || message.height != height) {
    return "image of " + SizeText(message.width, message.height) + " pixels, the camera file says " +
           SizeText(width, height);
  }
  const int64_t raw_size = static_cast<int64_t>(width) * height * (message.format == image_t::BGR8 ? 3 : 1);
  if (message.format != image_t::JPEG && message.num_bytes != raw_size) {
    return std::to_string(message.num_bytes) + " bytes for a raw image of " + SizeText(width, height) + " pixels";
  }
  if (message.format == image_t::JPEG) {
    const auto size = JpegSize(message.data);
    if (!size) return "the bytes are no JPEG";
    if (*size != std::pair(width, height)) {
      return "JPEG of " + SizeText(size->first, size->second) + " pixels, the message says " + SizeText(width, height);
    }
  }
  return message.utime < 0 ? "time is negative" : "";
}

DecodedImage DecodeImage(const image_t& message) {
  if (message.format == image_t::JPEG) {
    DecodedImage image = DecodeJpeg(message.data.data(), message.data.size());
    if (!image.pixels || (image.pixels->cols == message.width && image.pixels->rows == message.height)) return image;
    return {nullptr, "has another size than its header says"};
  }
  const int type = message.format == image_t::BGR8 ? CV_8UC3 : CV_8UC1;
  auto pixels = std::make_shared<cv::Mat>();
  *pixels = cv::Mat(message.height, message.width, type, const_cast<uint8_t*>(message.data.data())).clone();
  return {pixels, ""};
}

}  // namespace mapmend

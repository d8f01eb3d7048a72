#include "libs/image_messages/foreign_image.h"

#include <bot_core/image_t.hpp>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace mapmend {
namespace {

constexpr int32_t FourCc(const char (&name)[5]) { return name[0] | name[1] << 8 | name[2] << 16 | name[3] << 24; }

struct RawFormat {
  int32_t code;
  int cv_type;
  int to_bgr;  // OpenCV's conversion; -1: none is needed
};

constexpr RawFormat kRawFormats[] = {
    {FourCc("GREY"), CV_8UC1, -1},
    {FourCc("BGR3"), CV_8UC3, -1},
    {FourCc("RGB3"), CV_8UC3, cv::COLOR_RGB2BGR},
    {FourCc("RGB4"), CV_8UC4, cv::COLOR_RGBA2BGR},
    {FourCc("BGR4"), CV_8UC4, cv::COLOR_BGRA2BGR},
    {FourCc("YUYV"), CV_8UC2, cv::COLOR_YUV2BGR_YUYV},
    {FourCc("UYVY"), CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
};

constexpr int8_t kUnknownFormat = 127;

std::optional<RawFormat> FindFormat(int32_t code) {
  for (const RawFormat& format : kRawFormats) {
    if (format.code == code) return format;
  }
  return std::nullopt;
}

}  // namespace

bool DecodeForeignImage(const uint8_t* data, int size, image_t* image) {
  bot_core::image_t foreign;
  if (foreign.decode(data, 0, size) != size) return false;
  *image = image_t{};
  image->utime = foreign.utime;
  image->width = foreign.width;
  image->height = foreign.height;
  image->format = kUnknownFormat;
  image->data = std::move(foreign.data);
  image->num_bytes = foreign.size;
  if (foreign.pixelformat == FourCc("MJPG") || foreign.pixelformat == FourCc("JPEG")) {
    image->format = image_t::JPEG;
    return true;
  }
  const auto format = FindFormat(foreign.pixelformat);
  if (!format || foreign.width <= 0 || foreign.height <= 0) return true;
  const int64_t row = static_cast<int64_t>(foreign.width) * CV_ELEM_SIZE(format->cv_type);
  const int64_t stride = foreign.row_stride == 0 ? row : foreign.row_stride;
  const bool halves = CV_MAT_CN(format->cv_type) == 2;
  if (stride < row || (halves && foreign.width % 2 != 0) ||
      foreign.size < stride * (static_cast<int64_t>(foreign.height) - 1) + row) {
    return true;
  }
  const cv::Mat pixels(foreign.height, foreign.width, format->cv_type, image->data.data(), static_cast<size_t>(stride));
  cv::Mat converted;
  if (format->to_bgr >= 0) {
    cv::cvtColor(pixels, converted, format->to_bgr);
  } else {
    converted = pixels.clone();
  }
  image->format = converted.channels() == 1 ? image_t::GREY8 : image_t::BGR8;
  image->data.assign(converted.datastart, converted.dataend);
  image->num_bytes = static_cast<int32_t>(image->data.size());
  return true;
}

}  // namespace mapmend

#include "libs/map_view/keyframe_pixels.h"

#include <turbojpeg.h>

#include <algorithm>
#include <memory>
#include <opencv2/imgcodecs.hpp>

namespace mapmend {
namespace {

// By how much it may be shrunk while it is decoded.
int ShrinkOf(int longer_side, int wanted) {
  constexpr int kMost = 8;
  int shrink = 1;
  while (wanted > 0 && shrink < kMost && longer_side >= 2 * shrink * wanted) shrink *= 2;
  return shrink;
}

// Empty if it is no JPEG of one or three colours, or nothing of it can be read.
cv::Mat DecodeJpegPixels(const std::vector<uint8_t>& bytes, int side) {
  constexpr int kMaxSide = 30000;  // pixels; beyond it a header is taken for damaged
  const std::unique_ptr<void, int (*)(tjhandle)> decoder(tjInitDecompress(), tjDestroy);
  int width = 0, height = 0, subsampling = 0, colorspace = 0;
  if (!decoder ||
      tjDecompressHeader3(decoder.get(), bytes.data(), bytes.size(), &width, &height, &subsampling, &colorspace) != 0)
    return {};
  const bool is_plain = colorspace != TJCS_CMYK && colorspace != TJCS_YCCK;
  if (!is_plain || std::min(width, height) <= 0 || std::max(width, height) > kMaxSide) return {};
  const tjscalingfactor shrunk = {1, ShrinkOf(std::max(width, height), side)};
  cv::Mat pixels(TJSCALED(height, shrunk), TJSCALED(width, shrunk), CV_8UC3);
  if (tjDecompress2(decoder.get(), bytes.data(), bytes.size(), pixels.data, pixels.cols,
                    static_cast<int>(pixels.step[0]), pixels.rows, TJPF_BGR, 0) != 0 &&
      tjGetErrorCode(decoder.get()) == TJERR_FATAL)
    return {};
  return pixels;
}

}  // namespace

cv::Mat DecodePixels(const KeyframeImage& image, int side) {
  constexpr uint8_t kMarker = 0xFF, kStart = 0xD8;  // of JPEG
  if (image.bytes.size() > 2 && image.bytes[0] == kMarker && image.bytes[1] == kStart) {
    cv::Mat pixels = DecodeJpegPixels(image.bytes, side);
    if (!pixels.empty()) return pixels;
  }
  if (image.bytes.empty()) return {};
  return cv::imdecode(image.bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
}

}  // namespace mapmend

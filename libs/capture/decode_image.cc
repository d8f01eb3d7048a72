#include "libs/capture/decode_image.h"

#include <turbojpeg.h>

#include <cstring>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string_view>
#include <utility>
#include <vector>

namespace mapmend {
namespace {

constexpr int kMaxSide = 30000;  // pixels; beyond it a header is taken for damaged

DecodedImage Problem(const std::string& text) { return {nullptr, text}; }

// libjpeg's warnings about bytes that are missing or make no sense. Its others are about oddities that change no pixel.
bool MeansDamage(std::string_view warning) {
  for (const char* word : {"premature end", "Premature end", "bad Huffman", "bad arithmetic", "bad progression"}) {
    if (warning.find(word) != std::string_view::npos) return true;
  }
  return false;
}

bool IsJpeg(const std::vector<uint8_t>& bytes) { return bytes.size() > 2 && bytes[0] == 0xFF && bytes[1] == 0xD8; }

bool ReadBytes(const std::string& path, std::vector<uint8_t>* bytes) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  if (!file || size < 0) return false;
  bytes->resize(static_cast<size_t>(size));
  file.seekg(0);
  return size == 0 || file.read(reinterpret_cast<char*>(bytes->data()), size).good();
}

}  // namespace

DecodedImage DecodeJpeg(const uint8_t* bytes, size_t size) {
  if (size < 4) return Problem("is no JPEG");
  // A missing end marker alone costs no pixel. With one behind it, only pixels that are missing make a warning.
  std::vector<uint8_t> marked(bytes, bytes + size);
  marked.insert(marked.end(), {0xFF, 0xD9});
  const std::unique_ptr<void, int (*)(tjhandle)> decoder(tjInitDecompress(), tjDestroy);
  int width = 0, height = 0, subsampling = 0, colorspace = 0;
  if (size >= 2 && (bytes[0] != 0xFF || bytes[1] != 0xD8)) return Problem("is no JPEG");
  if (!decoder || tjDecompressHeader3(decoder.get(), marked.data(), marked.size(), &width, &height, &subsampling,
                                      &colorspace) != 0) {
    return Problem("is cut short");
  }
  if (width <= 0 || height <= 0 || width > kMaxSide || height > kMaxSide) return Problem("has a damaged header");
  auto pixels = std::make_shared<cv::Mat>();
  if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK) {
    // Four inks: OpenCV knows what to make of them.
    *pixels =
        cv::imdecode(std::vector<uint8_t>(bytes, bytes + size), cv::IMREAD_ANYCOLOR | cv::IMREAD_IGNORE_ORIENTATION);
    return pixels->empty() ? Problem("cannot be read as an image") : DecodedImage{pixels, ""};
  }
  const bool grey = colorspace == TJCS_GRAY;
  pixels->create(height, width, grey ? CV_8UC1 : CV_8UC3);
  if (tjDecompress2(decoder.get(), marked.data(), marked.size(), pixels->data, width, static_cast<int>(pixels->step[0]),
                    height, grey ? TJPF_GRAY : TJPF_BGR, 0) != 0) {
    if (tjGetErrorCode(decoder.get()) == TJERR_FATAL) return Problem("cannot be read as an image");
    const std::string_view warning = tjGetErrorStr2(decoder.get());
    if (MeansDamage(warning)) {
      return Problem(warning.find("remature end") != std::string_view::npos ? "is cut short" : "is damaged");
    }
  }
  return {pixels, ""};
}

DecodedImage ReadImageFile(const std::string& path) {
  std::vector<uint8_t> bytes;
  if (!ReadBytes(path, &bytes)) return Problem(std::string("cannot be read: ") + std::strerror(errno));
  if (bytes.empty()) return Problem("is empty");
  if (IsJpeg(bytes)) {
    DecodedImage image = DecodeJpeg(bytes.data(), bytes.size());
    if (image.pixels) image.jpeg = std::make_shared<const std::vector<uint8_t>>(std::move(bytes));
    return image;
  }
  auto pixels = std::make_shared<cv::Mat>();
  try {
    *pixels = cv::imdecode(bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    pixels->release();
  }
  if (pixels->empty()) return Problem("cannot be read as an image");
  return {pixels, ""};
}

}  // namespace mapmend

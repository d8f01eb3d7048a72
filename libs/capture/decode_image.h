#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// Pixels as the sensor gave them (tags about rotation are ignored: camera and intrinsics do not turn with the tag), or
// why there are none.
struct DecodedImage {
  std::shared_ptr<cv::Mat> pixels;  // grey or BGR, any depth; null with a problem
  std::string problem;              // e.g. "is cut short"; follows the name of the file
  std::shared_ptr<const std::vector<uint8_t>> jpeg =
      nullptr;  // the bytes that the pixels were decoded from; null: no JPEG
};

// JPEG, grey or colour. A JPEG of which a part is missing or damaged is a problem: decoders make that part grey or
// smeared, which tracking would take for ground.
DecodedImage DecodeJpeg(const uint8_t* bytes, size_t size);

// Any image file that OpenCV reads.
DecodedImage ReadImageFile(const std::string& path);

}  // namespace mapmend

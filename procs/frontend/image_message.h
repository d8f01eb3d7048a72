#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace cv {
class Mat;
}  // namespace cv

// Images on MAPMEND_IMAGE are untrusted: from any camera process, over a network.
namespace mapmend {

class image_t;

// The camera says that no more images come: an image of no size, without bytes.
bool IsEndOfStream(const image_t& message);

// Why an image is refused, one line; empty if it may be decoded. A JPEG's own header must agree, so that decoding never
// allocates more than the camera's size.
//   width, height  of the camera
//   last_utime     of the last image that was not refused; times must grow
std::string ImageProblem(const image_t& message, int width, int height, int64_t last_utime);

// 8-bit grey or BGR. Null if the JPEG is damaged. Call only without ImageProblem.
std::shared_ptr<cv::Mat> DecodeImage(const image_t& message);

}  // namespace mapmend

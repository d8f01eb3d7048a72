#pragma once

#include <string>

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// Where features may be, for images of width x height: 8 bit, 255 there, 0 where not. The file is
//   an image of the same shape (any size; colours and greys below 128 are 0; without alpha, or 0 where transparent), or
//   YAML with a key mask_rectangles as openvslam has it: a list of [x_min, x_max, y_min, y_max], fractions of the
//   image.
// Throws std::runtime_error with one line that names the file: unreadable, of another shape, or nothing left to see.
cv::Mat ReadMask(const std::string& path, int width, int height);

}  // namespace mapmend

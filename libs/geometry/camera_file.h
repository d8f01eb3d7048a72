#pragma once

#include <string>
#include <vector>

#include "libs/geometry/camera.h"

// Calibration files as people have them. data/cameras/README.md lists the formats.
namespace mapmend {

struct CameraFile {
  Camera camera;
  std::string format;              // of the file, for a person
  std::vector<std::string> notes;  // lines for the user: what was chosen, scaled, or cannot be used
};

// Reads a calibration; the format is told by the content. Of several cameras in one file the one of that size is taken
// (0 x 0: the first), and a note says so. Throws std::runtime_error with one line that names the file and the missing
// or wrong key; what is recognised but cannot be read is refused by the name of its format or lens model.
CameraFile ReadCameraFile(const std::string& path, int image_width = 0, int image_height = 0);

// The same for images of a known size, which the camera has afterwards: a calibration for another size of the same
// shape is scaled, with a note. Throws as well if the shapes differ, if a file without size cannot mean these images
// (principal point outside, focal length less than 0.2 or more than 10 times the width), or if the lens model has no
// inverse on more than a quarter of the image; on less, a note says so.
CameraFile ReadCameraFor(const std::string& path, int image_width, int image_height);

// A camera as a file that ReadCameraFile reads (the keys of ORB-SLAM's settings), with all digits. Models: pinhole and
// fisheye; throws std::runtime_error for others.
//   comments  lines for people at its head, without #
std::string FormatCameraFile(const Camera& camera, const std::vector<std::string>& comments);

// The share of the image, in a grid of 13 x 9 points, where the lens model has no inverse.
double ShareWithoutInverse(const Camera& camera);

}  // namespace mapmend

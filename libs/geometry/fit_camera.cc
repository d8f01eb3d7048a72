#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "libs/geometry/camera_file.h"
#include "libs/geometry/lens.h"

namespace mapmend {
namespace {

constexpr double kSameShape = 0.01;  // relative difference of the aspect ratios: rounding, or a few rows cut off
constexpr double kShortest = 0.2, kLongest = 10;  // focal length / width, where only the images tell the width
constexpr double kMostWithoutInverse = 0.25;      // of the grid
constexpr int kColumns = 13, kRows = 9;

std::string Size(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

}  // namespace

double ShareWithoutInverse(const Camera& camera) {
  if (camera.width <= 0 || camera.height <= 0 || !camera.HasDistortion()) return 0;
  const double limit = RadialLimit(camera);
  int without = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double u = (camera.width - 1) * column / double{kColumns - 1};
      const double v = (camera.height - 1) * row / double{kRows - 1};
      if (!Ray(camera, {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy}, limit)) ++without;
    }
  }
  return without / double{kColumns * kRows};
}

CameraFile ReadCameraFor(const std::string& path, int image_width, int image_height) {
  CameraFile result = ReadCameraFile(path, image_width, image_height);
  Camera& camera = result.camera;
  const auto fail = [&](const std::string& what) { throw std::runtime_error("camera file " + path + ": " + what); };
  char numbers[160];
  std::snprintf(numbers, sizeof(numbers), "fx %g, cx %g, cy %g", camera.fx, camera.cx, camera.cy);
  const double focal = camera.Ideal().fx;
  const std::string images = "the images have " + Size(image_width, image_height) + " pixels";
  if (camera.width <= 0) {
    camera.width = image_width;
    camera.height = image_height;
    if (camera.cx < 0 || camera.cy < 0 || camera.cx > image_width || camera.cy > image_height) {
      fail("its principal point (" + std::string(numbers) + ") lies outside: " + images +
           "; is it of another camera or resolution? With its width and height it could be scaled");
    }
    if (focal < kShortest * image_width || focal > kLongest * image_width) {
      fail("its focal length (" + std::string(numbers) + ") is out of all proportion: " + images +
           "; if it is right, add width and height to the file");
    }
  } else if (camera.width != image_width || camera.height != image_height) {
    const std::string sizes = images + ", the camera file says " + Size(camera.width, camera.height);
    const double aspect = image_width / static_cast<double>(image_height);
    const double calibrated = camera.width / static_cast<double>(camera.height);
    if (std::abs(aspect / calibrated - 1) > kSameShape) {
      const bool turned = std::abs(aspect * calibrated - 1) <= kSameShape && std::abs(aspect - 1) > kSameShape;
      fail(sizes + (turned ? ": turned by 90 degrees; turn the images back, or calibrate them as they are"
                           : ": of another shape, cut or stretched; calibrate with images as they are flown"));
    }
    const auto in_the_middle = [](double centre, int size) { return centre > 0.25 * size && centre < 0.75 * size; };
    if (!in_the_middle(camera.cx, camera.width) || !in_the_middle(camera.cy, camera.height) ||
        focal < kShortest * camera.width || focal > kLongest * camera.width) {
      fail(sizes + ", and its numbers (" + numbers +
           ") do not look like a camera of that size; are width and height right?");
    }
    camera = camera.Resized(image_width, image_height);
    result.notes.push_back("camera " + path + ": " + sizes + "; the calibration is scaled");
  }
  const double share = ShareWithoutInverse(camera);
  if (share > kMostWithoutInverse) {
    fail("the lens model (" + camera.ModelName() + ") has no inverse on " + std::to_string(std::lround(100 * share)) +
         " % of the image; are its coefficients in the right order, and of the right sign?");
  }
  if (share > 0) {
    result.notes.push_back("camera " + path + ": the lens model has no inverse on " +
                           std::to_string(std::max(1l, std::lround(100 * share))) +
                           " % of the image, at its edge; features there are left out");
  }
  return result;
}

}  // namespace mapmend

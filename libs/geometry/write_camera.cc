#include <stdexcept>

#include "libs/base/text_format.h"
#include "libs/geometry/camera_file.h"

namespace mapmend {

std::string FormatCameraFile(const Camera& camera, const std::vector<std::string>& comments) {
  const bool is_fisheye = camera.model == Camera::Model::kFisheye;
  if (!is_fisheye && camera.model != Camera::Model::kPinhole)
    throw std::runtime_error("a camera of the model " + camera.ModelName() + " cannot be written as a file");
  std::string text = "%YAML:1.0\n";
  for (const std::string& comment : comments) text += "# " + comment + "\n";
  text += std::string("Camera.type: \"") + (is_fisheye ? "KannalaBrandt8" : "PinHole") + "\"\n";
  const auto add = [&](const char* key, double value) { text += Format("Camera.%s: %.12g\n", key, value); };
  add("fx", camera.fx);
  add("fy", camera.fy);
  add("cx", camera.cx);
  add("cy", camera.cy);
  const char* const pinhole[] = {"k1", "k2", "p1", "p2", "k3"};
  const char* const fisheye[] = {"k1", "k2", "k3", "k4"};
  for (int i = 0; i < (is_fisheye ? 4 : 5); ++i) add(is_fisheye ? fisheye[i] : pinhole[i], camera.distortion[i]);
  add("width", camera.width);
  add("height", camera.height);
  if (camera.fps > 0) add("fps", camera.fps);
  return text;
}

}  // namespace mapmend

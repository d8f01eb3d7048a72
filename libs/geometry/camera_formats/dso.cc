#include <algorithm>
#include <cmath>
#include <sstream>

#include "libs/base/text_table.h"
#include "libs/geometry/camera_formats/camera_format.h"

// camera.txt of DSO and LSD-SLAM: a model with its numbers (pixels, or fractions of the image), the size of the images,
// and two lines on how those programs are to rectify them, which are not for mapmend.
namespace mapmend {
namespace {

std::vector<std::vector<std::string>> Lines(const std::string& text) {
  std::vector<std::vector<std::string>> result;
  std::istringstream lines(text.substr(0, 100000));
  for (std::string line; std::getline(lines, line) && result.size() < 5;) {
    std::istringstream fields(line);
    std::vector<std::string> words;
    for (std::string word; fields >> word;) words.push_back(word);
    if (!words.empty() && words[0][0] != '#') result.push_back(words);
  }
  return result;
}

bool IsName(const std::string& word) {
  static const char* const kNames[] = {"Pinhole", "FOV", "ATAN", "RadTan", "EquiDistant", "KannalaBrandt"};
  return std::any_of(std::begin(kNames), std::end(kNames), [&](const char* name) { return word == name; });
}

double ToNumber(const std::string& word) {
  double value = 0;
  if (!ParseNumber(word, &value) || !std::isfinite(value))
    RefuseCamera("\"" + word.substr(0, 40) + "\" is not a number");
  return value;
}

}  // namespace

bool IsDso(const CameraText& file) {
  if (file.bytes.find('\0') != std::string::npos) return false;
  const auto lines = Lines(file.bytes);
  if (lines.empty()) return false;
  if (IsName(lines[0][0])) return true;
  double ignored = 0;
  const bool numbers = std::all_of(lines[0].begin(), lines[0].end(),
                                   [&](const std::string& word) { return ParseNumber(word, &ignored); });
  return numbers && lines[0].size() >= 5 && lines.size() >= 2 && lines[1].size() == 2;
}

CameraFile ReadDso(const CameraText& file) {
  const auto lines = Lines(file.bytes);
  std::vector<std::string> words = lines[0];
  std::string model;
  if (IsName(words[0])) {
    model = words[0];
    words.erase(words.begin());
  } else {
    model = words.size() == 8 ? "RadTan" : "FOV";
  }
  const size_t count = model == "RadTan" || model == "EquiDistant" || model == "KannalaBrandt" ? 8 : 5;
  // The zero at the end of Pinhole is often left out.
  if (model == "Pinhole" && words.size() == 4) words.push_back("0");
  if (words.size() != count) {
    RefuseCamera("line 1: " + model + " needs " + std::to_string(count) + " numbers, it has " +
                 std::to_string(words.size()));
  }
  std::vector<double> values;
  for (const std::string& word : words) values.push_back(ToNumber(word));
  if (lines.size() < 2 || lines[1].size() < 2) RefuseCamera("line 2, width and height, is missing");
  CameraFile result;
  Camera& camera = result.camera;
  const double width = ToNumber(lines[1][0]), height = ToNumber(lines[1][1]);
  for (const double size : {width, height}) {
    if (!(size >= 1 && size <= 65535 && size == std::floor(size)))
      RefuseCamera("line 2: width and height must be 1 to 65535 pixels");
  }
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  SetIntrinsics(values, &camera);
  if (camera.cx < 1 && camera.cy < 1) {
    camera.fx *= width;
    camera.fy *= height;
    camera.cx = camera.cx * width - 0.5;
    camera.cy = camera.cy * height - 0.5;
  }
  const std::vector<double> rest(values.begin() + 4, values.end());
  if (count == 5)
    SetNamedDistortion(model == "Pinhole" ? "none" : "fov", rest, "line 1", "line 1", &camera);
  else if (model == "RadTan")
    SetOpenCvDistortion(rest, "line 1", &camera);
  else
    SetFisheyeDistortion(rest, "line 1", &camera);
  return result;
}

}  // namespace mapmend

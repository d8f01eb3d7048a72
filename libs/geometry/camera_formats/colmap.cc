#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <sstream>

#include "libs/base/text_table.h"
#include "libs/geometry/camera_formats/camera_format.h"

// COLMAP's cameras.txt (CAMERA_ID MODEL WIDTH HEIGHT PARAMS...) and cameras.bin, which says the same.
namespace mapmend {
namespace {

struct ColmapModel {
  const char* name;
  size_t num_parameters;
};
// By COLMAP's numbers.
constexpr ColmapModel kColmapModels[] = {{"SIMPLE_PINHOLE", 3},
                                         {"PINHOLE", 4},
                                         {"SIMPLE_RADIAL", 4},
                                         {"RADIAL", 5},
                                         {"OPENCV", 8},
                                         {"OPENCV_FISHEYE", 8},
                                         {"FULL_OPENCV", 12},
                                         {"FOV", 5},
                                         {"SIMPLE_RADIAL_FISHEYE", 4},
                                         {"RADIAL_FISHEYE", 5},
                                         {"THIN_PRISM_FISHEYE", 12}};

struct ColmapCamera {
  int64_t id = 0;
  std::string model;
  double width = 0, height = 0;
  std::vector<double> p;
};

Camera Convert(const ColmapCamera& from) {
  const auto known = std::find_if(std::begin(kColmapModels), std::end(kColmapModels),
                                  [&](const ColmapModel& model) { return from.model == model.name; });
  if (known == std::end(kColmapModels)) {
    std::string names;
    for (const ColmapModel& model : kColmapModels) names += (names.empty() ? "" : ", ") + std::string(model.name);
    RefuseCamera("camera model " + from.model + " is not known; known are " + names);
  }
  if (from.p.size() != known->num_parameters) {
    RefuseCamera("model " + from.model + " needs " + std::to_string(known->num_parameters) + " parameters, it has " +
                 std::to_string(from.p.size()));
  }
  for (const double size : {from.width, from.height}) {
    if (!(size >= 1 && size <= 65535 && size == std::floor(size)))
      RefuseCamera("width and height must be 1 to 65535 pixels");
  }
  const std::string& model = from.model;
  Camera camera;
  camera.width = static_cast<int>(from.width);
  camera.height = static_cast<int>(from.height);
  const bool one_focal = model.starts_with("SIMPLE") || model.starts_with("RADIAL");
  const size_t centre = one_focal ? 1 : 2;
  // COLMAP puts the centre of the first pixel at (0.5, 0.5), OpenCV and mapmend at (0, 0).
  SetIntrinsics({from.p[0], from.p[centre - 1], from.p[centre] - 0.5, from.p[centre + 1] - 0.5}, &camera);
  const std::vector<double> rest(from.p.begin() + static_cast<std::ptrdiff_t>(centre + 2), from.p.end());
  if (model == "FOV") {
    SetNamedDistortion("fov", rest, "model FOV", "model FOV", &camera);
  } else if (model == "FULL_OPENCV") {
    SetOpenCvDistortion(rest, "model FULL_OPENCV", &camera);
  } else {
    if (model == "THIN_PRISM_FISHEYE")
      camera.model = Camera::Model::kThinPrismFisheye;
    else if (model.ends_with("FISHEYE"))
      camera.model = Camera::Model::kFisheye;
    std::copy(rest.begin(), rest.end(), camera.distortion.begin());
  }
  return camera;
}

CameraFile Choose(const CameraText& file, const std::vector<ColmapCamera>& cameras) {
  if (cameras.empty()) RefuseCamera("no camera found; expected lines CAMERA_ID MODEL WIDTH HEIGHT PARAMS...");
  const auto fitting = std::find_if(cameras.begin(), cameras.end(), [&](const ColmapCamera& camera) {
    return file.image_width > 0 && camera.width == file.image_width && camera.height == file.image_height;
  });
  const ColmapCamera& taken = fitting != cameras.end() ? *fitting : cameras.front();
  CameraFile result;
  result.camera = Convert(taken);
  if (cameras.size() > 1) {
    result.notes.push_back("of " + std::to_string(cameras.size()) + " cameras the one with id " +
                           std::to_string(taken.id) + " is taken (" + taken.model + ", " +
                           std::to_string(result.camera.width) + " x " + std::to_string(result.camera.height) + ")");
  }
  return result;
}

// Fixed width, little-endian, as COLMAP writes it.
class BinaryReader {
 public:
  explicit BinaryReader(const std::string& bytes) : bytes_(bytes) {}
  template <typename T>
  T Take() {
    T value{};
    if (bytes_.size() - at_ < sizeof(T)) RefuseCamera("is cut short");
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  bool AtEnd() const { return at_ == bytes_.size(); }

 private:
  const std::string& bytes_;
  size_t at_ = 0;
};

bool IsModelName(const std::string& word) {
  return word.size() >= 3 && word.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789") == std::string::npos &&
         std::isalpha(static_cast<unsigned char>(word[0]));
}

}  // namespace

bool IsColmapText(const CameraText& file) {
  std::istringstream lines(file.bytes);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string id, model;
    if (!(fields >> id) || id[0] == '#') continue;
    return id.find_first_not_of("0123456789") == std::string::npos && (fields >> model) && IsModelName(model);
  }
  return false;
}

CameraFile ReadColmapText(const CameraText& file) {
  std::vector<ColmapCamera> cameras;
  std::istringstream lines(file.bytes);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string id;
    if (!(fields >> id) || id[0] == '#') continue;
    ColmapCamera camera;
    if (id.size() > 9 || id.find_first_not_of("0123456789") != std::string::npos)
      RefuseCamera("camera id \"" + id.substr(0, 40) + "\" is not a number");
    camera.id = std::stol(id);
    fields >> camera.model;
    double* const sizes[] = {&camera.width, &camera.height};
    int index = 0;
    for (std::string word; fields >> word; ++index) {
      double value = 0;
      if (!ParseNumber(word, &value) || !std::isfinite(value))
        RefuseCamera("parameter \"" + word.substr(0, 40) + "\" is not a number");
      if (index < 2)
        *sizes[index] = value;
      else
        camera.p.push_back(value);
    }
    cameras.push_back(camera);
  }
  return Choose(file, cameras);
}

bool IsColmapBinary(const CameraText& file) {
  if (file.bytes.size() < 8 + 24 || file.bytes.find('\0') == std::string::npos) return false;
  BinaryReader reader(file.bytes);
  const auto count = reader.Take<uint64_t>();
  reader.Take<uint32_t>();
  return count > 0 && count < 10000000 && reader.Take<int32_t>() < 100;
}

CameraFile ReadColmapBinary(const CameraText& file) {
  BinaryReader reader(file.bytes);
  std::vector<ColmapCamera> cameras;
  const auto count = reader.Take<uint64_t>();
  for (uint64_t i = 0; i < count; ++i) {
    ColmapCamera camera;
    camera.id = reader.Take<uint32_t>();
    const auto model = reader.Take<int32_t>();
    camera.width = static_cast<double>(reader.Take<uint64_t>());
    camera.height = static_cast<double>(reader.Take<uint64_t>());
    if (model < 0 || model >= static_cast<int32_t>(std::size(kColmapModels)))
      RefuseCamera("camera model number " + std::to_string(model) + " is not known");
    camera.model = kColmapModels[model].name;
    for (size_t k = 0; k < kColmapModels[model].num_parameters; ++k) {
      camera.p.push_back(reader.Take<double>());
      if (!std::isfinite(camera.p.back())) RefuseCamera("a parameter is not finite");
    }
    cameras.push_back(camera);
  }
  if (!reader.AtEnd()) RefuseCamera("has more bytes than its " + std::to_string(count) + " cameras");
  return Choose(file, cameras);
}

}  // namespace mapmend

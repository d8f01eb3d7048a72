#include "libs/geometry/camera_formats/camera_format.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace mapmend {
namespace {

double ToNumber(const YAML::Node& node, const std::string& named) {
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value)) RefuseCamera(named + " is not a number");
  if (!std::isfinite(value)) RefuseCamera(named + " is not finite");
  return value;
}

void Collect(const YAML::Node& node, const std::string& named, int depth, std::vector<double>* values) {
  if (!node.IsSequence()) {
    values->push_back(ToNumber(node, named));
  } else {
    if (depth > 2) RefuseCamera(named + " is not a list of numbers");
    for (const auto& entry : node) Collect(entry, named, depth + 1, values);
  }
  if (values->size() > 1000) RefuseCamera(named + " has too many numbers");
}

}  // namespace

void RefuseCamera(const std::string& what) { throw std::runtime_error(what); }

CameraKeys::CameraKeys(const YAML::Node& map, std::string prefix) : map_(map), prefix_(std::move(prefix)) {}

YAML::Node CameraKeys::Get(const std::string& key) const {
  const YAML::Node& map = map_;
  const YAML::Node node = map.IsMap() ? map[key] : YAML::Node(YAML::NodeType::Undefined);
  if (!node) RefuseCamera(Named(key) + " is missing");
  return node;
}

bool CameraKeys::Has(const std::string& key) const {
  const YAML::Node& map = map_;
  return map.IsMap() && map[key];
}

std::string CameraKeys::FirstOf(const std::vector<std::string>& keys) const {
  const auto found = std::find_if(keys.begin(), keys.end(), [&](const std::string& key) { return Has(key); });
  return found == keys.end() ? keys[0] : *found;
}

double CameraKeys::Number(const std::string& key) const { return ToNumber(Get(key), Named(key)); }

double CameraKeys::NumberOr(const std::string& key, double fallback) const { return Has(key) ? Number(key) : fallback; }

std::string CameraKeys::Word(const std::string& key) const {
  const YAML::Node node = Get(key);
  if (node.IsNull()) return "";
  if (!node.IsScalar()) RefuseCamera(Named(key) + " is not a word");
  return node.Scalar();
}

int CameraKeys::Pixels(const std::string& key) const {
  const double value = Number(key);
  if (value < 1 || value > 65535 || value != std::floor(value))
    RefuseCamera(Named(key) + " is not a number of pixels (1 to 65535)");
  return static_cast<int>(value);
}

std::vector<double> CameraKeys::Numbers(const std::string& key) const {
  YAML::Node node = Get(key);
  std::string named = Named(key);
  if (node.IsMap()) {
    const YAML::Node data = node["data"];
    named += ".data";
    if (!data) RefuseCamera(named + " is missing");
    node = data;
  }
  std::vector<double> values;
  if (node.IsNull()) return values;
  if (!node.IsSequence()) RefuseCamera(named + " is not a list of numbers");
  Collect(node, named, 0, &values);
  return values;
}

std::vector<double> CameraKeys::Numbers(const std::string& key, size_t count) const {
  std::vector<double> values = Numbers(key);
  if (values.size() != count)
    RefuseCamera(Named(key) + " needs " + std::to_string(count) + " numbers, it has " + std::to_string(values.size()));
  return values;
}

CameraKeys CameraKeys::Sub(const std::string& key) const {
  const YAML::Node node = Get(key);
  if (!node.IsMap()) RefuseCamera(Named(key) + " holds no keys");
  return {node, prefix_ + key + "."};
}

void CameraKeys::ReadIntrinsics(const std::string& prefix, Camera* camera) const {
  camera->fx = Number(prefix + "fx");
  camera->fy = Number(prefix + "fy");
  camera->cx = Number(prefix + "cx");
  camera->cy = Number(prefix + "cy");
}

void CameraKeys::ReadSize(const std::string& width, const std::string& height, Camera* camera) const {
  if (!Has(width) && !Has(height)) return;
  camera->width = Pixels(width);
  camera->height = Pixels(height);
}

void SetIntrinsics(const std::vector<double>& values, Camera* camera) {
  camera->fx = values.at(0);
  camera->fy = values.at(1);
  camera->cx = values.at(2);
  camera->cy = values.at(3);
}

void SetOpenCvDistortion(const std::vector<double>& values, const std::string& what, Camera* camera) {
  const size_t n = values.size();
  if (n != 0 && n != 4 && n != 5 && n != 8 && n != 12 && n != 14) {
    RefuseCamera(what + " has " + std::to_string(n) + " coefficients; known are 0, 4, 5, 8, 12 and 14");
  }
  const bool more = std::any_of(values.begin() + static_cast<std::ptrdiff_t>(std::min<size_t>(n, 5)), values.end(),
                                [](double v) { return v != 0; });
  camera->model = more ? Camera::Model::kRational : Camera::Model::kPinhole;
  std::copy(values.begin(), values.end(), camera->distortion.begin());
}

void SetFisheyeDistortion(const std::vector<double>& values, const std::string& what, Camera* camera) {
  const bool rest = values.size() > 4 && std::any_of(values.begin() + 4, values.end(), [](double v) { return v != 0; });
  if (values.size() < 4 || rest)
    RefuseCamera(what + " needs 4 numbers for a fisheye lens, it has " + std::to_string(values.size()));
  camera->model = Camera::Model::kFisheye;
  std::copy_n(values.begin(), 4, camera->distortion.begin());
}

void SetNamedDistortion(const std::string& name, const std::vector<double>& values, const std::string& key,
                        const std::string& values_key, Camera* camera) {
  const auto need = [&](size_t count) {
    if (values.size() != count) {
      RefuseCamera(values_key + " needs " + std::to_string(count) + " numbers for the model " + name + ", it has " +
                   std::to_string(values.size()));
    }
  };
  if (name == "radtan" || name == "radial-tangential" || name == "plumb_bob" || name == "brown_conrady" ||
      name == "rational_polynomial" || name == "thin_prism" || name == "radtan8" || name == "brown") {
    SetOpenCvDistortion(values, values_key, camera);
  } else if (name == "equidistant" || name == "equi" || name == "fisheye" || name == "kannala_brandt" ||
             name == "kannala_brandt4") {
    SetFisheyeDistortion(values, values_key, camera);
  } else if (name == "fov" || name == "FOV" || name == "atan" || name == "ATAN") {
    need(1);
    camera->model = values[0] == 0 ? Camera::Model::kPinhole : Camera::Model::kFov;
    camera->distortion[0] = values[0];
  } else if (name == "none" || name.empty() || name == "None" || name == "pinhole") {
    if (std::any_of(values.begin(), values.end(), [](double v) { return v != 0; })) {
      RefuseCamera(key + " is \"" + name + "\", but there are coefficients that are not zero; name their model, e.g. " +
                   "radtan, plumb_bob or equidistant, or make them zero");
    }
  } else {
    RefuseCamera(key + " is \"" + name + "\"; known are radtan (plumb_bob, radial-tangential), rational_polynomial, " +
                 "equidistant (fisheye), fov, none");
  }
}

}  // namespace mapmend

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "libs/geometry/camera.h"

namespace mapmend {
namespace {

[[noreturn]] void Fail(const std::string& path, const std::string& what) {
  throw std::runtime_error("camera file " + path + ": " + what);
}

double Number(const std::string& path, const YAML::Node& node, const std::string& key) {
  double value = 0;
  try {
    value = node.as<double>();
  } catch (const YAML::Exception&) {
    Fail(path, "key " + key + " is not a number");
  }
  if (!std::isfinite(value)) Fail(path, "key " + key + " is not finite");
  return value;
}

// ORB-SLAM2/3: flat keys, "Camera." or (ORB-SLAM3 version 1.0) "Camera1." before the intrinsics.
Camera ReadOrbSlam(const std::string& path, const YAML::Node& root) {
  const std::string prefix = root["Camera1.fx"] ? "Camera1." : "Camera.";
  const auto required = [&](const std::string& key) {
    if (!root[key]) Fail(path, "key " + key + " is missing");
    return Number(path, root[key], key);
  };
  const auto optional = [&](const std::string& key) { return root[key] ? Number(path, root[key], key) : 0.0; };
  Camera camera;
  if (root["Camera.type"]) {
    const auto type = root["Camera.type"].as<std::string>();
    if (type == "KannalaBrandt8") {
      camera.model = Camera::Model::kFisheye;
    } else if (type != "PinHole" && type != "Pinhole") {
      Fail(path, "key Camera.type is \"" + type + "\"; known are PinHole and KannalaBrandt8");
    }
  }
  camera.fx = required(prefix + "fx");
  camera.fy = required(prefix + "fy");
  camera.cx = required(prefix + "cx");
  camera.cy = required(prefix + "cy");
  if (camera.model == Camera::Model::kPinhole) {
    const char* names[] = {"k1", "k2", "p1", "p2", "k3"};
    for (int i = 0; i < 5; ++i) camera.distortion[i] = optional(prefix + names[i]);
  } else {
    const char* names[] = {"k1", "k2", "k3", "k4"};
    for (int i = 0; i < 4; ++i) camera.distortion[i] = required(prefix + names[i]);
  }
  camera.width = static_cast<int>(optional("Camera.width"));
  camera.height = static_cast<int>(optional("Camera.height"));
  camera.fps = optional("Camera.fps");
  return camera;
}

// Kalibr camchain: the first camera.
Camera ReadKalibr(const std::string& path, const YAML::Node& cam) {
  const auto list = [&](const char* key, size_t size) {
    const YAML::Node node = cam[key];
    if (!node) Fail(path, std::string("key cam0.") + key + " is missing");
    if (!node.IsSequence() || node.size() < size) {
      Fail(path, std::string("key cam0.") + key + " needs " + std::to_string(size) + " numbers");
    }
    std::vector<double> values;
    for (const auto& entry : node) values.push_back(Number(path, entry, std::string("cam0.") + key));
    return values;
  };
  const auto camera_model = cam["camera_model"] ? cam["camera_model"].as<std::string>() : "pinhole";
  if (camera_model != "pinhole") Fail(path, "key cam0.camera_model is \"" + camera_model + "\"; known is pinhole");
  Camera camera;
  const auto distortion_model = cam["distortion_model"] ? cam["distortion_model"].as<std::string>() : "none";
  if (distortion_model == "equidistant") {
    camera.model = Camera::Model::kFisheye;
  } else if (distortion_model != "radtan" && distortion_model != "none") {
    Fail(path, "key cam0.distortion_model is \"" + distortion_model + "\"; known are radtan, equidistant, none");
  }
  const auto intrinsics = list("intrinsics", 4);
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  if (distortion_model != "none") {
    const auto coefficients = list("distortion_coeffs", 4);
    for (int i = 0; i < 4; ++i) camera.distortion[i] = coefficients[i];
  }
  const auto resolution = list("resolution", 2);
  camera.width = static_cast<int>(resolution[0]);
  camera.height = static_cast<int>(resolution[1]);
  return camera;
}

// OpenCV calibration yaml: camera_matrix, distortion_coefficients (either as !!opencv-matrix or with "data" and rows/cols).
Camera ReadOpenCv(const std::string& path, const YAML::Node& root) {
  const auto data = [&](const char* key, size_t size) {
    const YAML::Node node = root[key];
    if (!node || !node["data"]) Fail(path, std::string("key ") + key + ".data is missing");
    std::vector<double> values;
    for (const auto& entry : node["data"]) values.push_back(Number(path, entry, std::string(key) + ".data"));
    if (values.size() < size) Fail(path, std::string("key ") + key + ".data needs " + std::to_string(size) + " numbers");
    return values;
  };
  Camera camera;
  const auto matrix = data("camera_matrix", 9);
  camera.fx = matrix[0];
  camera.fy = matrix[4];
  camera.cx = matrix[2];
  camera.cy = matrix[5];
  const YAML::Node fisheye = root["fisheye_model"];
  const YAML::Node model = root["distortion_model"];
  if ((fisheye && fisheye.as<std::string>() == "1") ||
      (model && (model.as<std::string>() == "equidistant" || model.as<std::string>() == "fisheye"))) {
    camera.model = Camera::Model::kFisheye;
  }
  const auto coefficients = data("distortion_coefficients", 4);
  const size_t count = camera.model == Camera::Model::kFisheye ? 4 : std::min<size_t>(5, coefficients.size());
  for (size_t i = 0; i < count; ++i) camera.distortion[i] = coefficients[i];
  if (root["image_width"]) camera.width = static_cast<int>(Number(path, root["image_width"], "image_width"));
  if (root["image_height"]) camera.height = static_cast<int>(Number(path, root["image_height"], "image_height"));
  return camera;
}

// COLMAP cameras.txt: the first camera. CAMERA_ID MODEL WIDTH HEIGHT PARAMS...
Camera ReadColmap(const std::string& path, const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    int id = 0;
    std::string model;
    Camera camera;
    if (!(fields >> id >> model >> camera.width >> camera.height)) break;
    std::vector<double> p;
    for (double value = 0; fields >> value;) p.push_back(value);
    const auto need = [&](size_t size) {
      if (p.size() != size) Fail(path, "model " + model + " needs " + std::to_string(size) + " parameters");
    };
    // COLMAP puts the centre of the first pixel at (0.5, 0.5), OpenCV and mapmend at (0, 0).
    const auto set = [&](double fx, double fy, double cx, double cy) {
      camera.fx = fx;
      camera.fy = fy;
      camera.cx = cx - 0.5;
      camera.cy = cy - 0.5;
    };
    auto& d = camera.distortion;
    if (model == "SIMPLE_PINHOLE") {
      need(3), set(p[0], p[0], p[1], p[2]);
    } else if (model == "PINHOLE") {
      need(4), set(p[0], p[1], p[2], p[3]);
    } else if (model == "SIMPLE_RADIAL") {
      need(4), set(p[0], p[0], p[1], p[2]), d[0] = p[3];
    } else if (model == "RADIAL") {
      need(5), set(p[0], p[0], p[1], p[2]), d[0] = p[3], d[1] = p[4];
    } else if (model == "OPENCV") {
      need(8), set(p[0], p[1], p[2], p[3]), std::copy(p.begin() + 4, p.end(), d.begin());
    } else if (model == "OPENCV_FISHEYE") {
      need(8), set(p[0], p[1], p[2], p[3]), std::copy(p.begin() + 4, p.end(), d.begin());
      camera.model = Camera::Model::kFisheye;
    } else {
      Fail(path, "camera model " + model + " is not known; known are SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, "
                 "OPENCV, OPENCV_FISHEYE");
    }
    return camera;
  }
  Fail(path, "no camera found (expected: CAMERA_ID MODEL WIDTH HEIGHT PARAMS...)");
}

void CheckCamera(const std::string& path, const Camera& camera) {
  if (camera.fx <= 0 || camera.fy <= 0) Fail(path, "the focal lengths fx and fy must be positive");
  if (camera.width < 0 || camera.height < 0) Fail(path, "width and height must not be negative");
  if (camera.width > 0 && (camera.cx < 0 || camera.cx > camera.width)) Fail(path, "cx lies outside the image");
  if (camera.height > 0 && (camera.cy < 0 || camera.cy > camera.height)) Fail(path, "cy lies outside the image");
}

}  // namespace

Camera ReadCamera(const std::string& path) {
  std::ifstream file(path);
  if (!file) Fail(path, "cannot be read");
  std::ostringstream content;
  content << file.rdbuf();
  const std::string text = content.str();
  // A first line "%YAML:1.0", as OpenCV writes it, is not YAML.
  std::string yaml;
  std::istringstream lines(text);
  bool first = true;
  for (std::string line; std::getline(lines, line); first = false) {
    if (first && line.starts_with("%YAML")) continue;
    yaml += line + "\n";
  }
  Camera camera;
  YAML::Node root;
  bool is_map = false;
  try {
    root = YAML::Load(yaml);
    is_map = root.IsMap();
  } catch (const YAML::Exception& e) {
    if (path.ends_with(".txt")) is_map = false;
    else Fail(path, std::string("is not YAML: ") + e.what());
  }
  if (!is_map) {
    camera = ReadColmap(path, text);
  } else if (root["cam0"]) {
    camera = ReadKalibr(path, root["cam0"]);
  } else if (root["camera_matrix"]) {
    camera = ReadOpenCv(path, root);
  } else {
    camera = ReadOrbSlam(path, root);
  }
  CheckCamera(path, camera);
  return camera;
}

}  // namespace mapmend

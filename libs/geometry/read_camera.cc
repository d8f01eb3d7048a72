#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
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

// A number of pixels.
int Size(const std::string& path, const YAML::Node& node, const std::string& key) {
  const double value = Number(path, node, key);
  if (value < 1 || value > 65535 || value != std::floor(value))
    Fail(path, "key " + key + " is not a number of pixels (1 to 65535)");
  return static_cast<int>(value);
}

std::string Text(const std::string& path, const YAML::Node& node, const std::string& key) {
  if (!node.IsScalar()) Fail(path, "key " + key + " is not a word");
  return node.Scalar();
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
    const auto type = Text(path, root["Camera.type"], "Camera.type");
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
    // All or none: a single one that is missing is misspelt. k3 may be left out, as ORB-SLAM allows.
    bool any = false;
    for (const char* name : names) any = any || root[prefix + name];
    for (int i = 0; any && i < 4; ++i) camera.distortion[i] = required(prefix + names[i]);
    camera.distortion[4] = optional(prefix + names[4]);
  } else {
    const char* names[] = {"k1", "k2", "k3", "k4"};
    for (int i = 0; i < 4; ++i) camera.distortion[i] = required(prefix + names[i]);
  }
  if (root["Camera.width"]) camera.width = Size(path, root["Camera.width"], "Camera.width");
  if (root["Camera.height"]) camera.height = Size(path, root["Camera.height"], "Camera.height");
  if ((camera.width > 0) != (camera.height > 0)) {
    Fail(path, std::string("key ") + (camera.width > 0 ? "Camera.height" : "Camera.width") + " is missing");
  }
  camera.fps = optional("Camera.fps");
  if (camera.fps < 0) Fail(path, "key Camera.fps is negative");
  return camera;
}

// Kalibr camchain: the first camera.
Camera ReadKalibr(const std::string& path, const YAML::Node& cam) {
  if (!cam.IsMap()) Fail(path, "key cam0 holds no keys");
  const auto list = [&](const char* key, size_t size) {
    const YAML::Node node = cam[key];
    if (!node) Fail(path, std::string("key cam0.") + key + " is missing");
    if (!node.IsSequence() || node.size() != size) {
      Fail(path, std::string("key cam0.") + key + " needs " + std::to_string(size) + " numbers");
    }
    std::vector<double> values;
    for (const auto& entry : node) values.push_back(Number(path, entry, std::string("cam0.") + key));
    return values;
  };
  const auto word = [&](const char* key) {
    if (!cam[key]) Fail(path, std::string("key cam0.") + key + " is missing");
    return Text(path, cam[key], std::string("cam0.") + key);
  };
  const auto camera_model = word("camera_model");
  if (camera_model != "pinhole") Fail(path, "key cam0.camera_model is \"" + camera_model + "\"; known is pinhole");
  Camera camera;
  const auto distortion_model = word("distortion_model");
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
  list("resolution", 2);
  camera.width = Size(path, cam["resolution"][0], "cam0.resolution");
  camera.height = Size(path, cam["resolution"][1], "cam0.resolution");
  return camera;
}

// OpenCV calibration yaml: camera_matrix, distortion_coefficients (either as !!opencv-matrix or with "data" and
// rows/cols).
Camera ReadOpenCv(const std::string& path, const YAML::Node& root) {
  const auto data = [&](const char* key, size_t size) {
    const YAML::Node node = root[key];
    if (!node) Fail(path, std::string("key ") + key + " is missing");
    if (!node.IsMap() || !node["data"]) Fail(path, std::string("key ") + key + ".data is missing");
    std::vector<double> values;
    for (const auto& entry : node["data"]) values.push_back(Number(path, entry, std::string(key) + ".data"));
    if (values.size() < size)
      Fail(path, std::string("key ") + key + ".data needs " + std::to_string(size) + " numbers, it has " +
                     std::to_string(values.size()));
    return values;
  };
  Camera camera;
  const auto matrix = data("camera_matrix", 9);
  if (matrix.size() != 9) Fail(path, "key camera_matrix.data needs 9 numbers, it has " + std::to_string(matrix.size()));
  if (matrix[1] != 0 || matrix[3] != 0 || matrix[6] != 0 || matrix[7] != 0 || matrix[8] != 1) {
    Fail(path, "key camera_matrix.data is not [fx 0 cx, 0 fy cy, 0 0 1]");
  }
  camera.fx = matrix[0];
  camera.fy = matrix[4];
  camera.cx = matrix[2];
  camera.cy = matrix[5];
  if (const YAML::Node fisheye = root["fisheye_model"]) {
    const std::string value = Text(path, fisheye, "fisheye_model");
    if (value == "1" || value == "true")
      camera.model = Camera::Model::kFisheye;
    else if (value != "0" && value != "false")
      Fail(path, "key fisheye_model is \"" + value + "\"; known are 0 and 1");
  }
  if (const YAML::Node model = root["distortion_model"]) {
    const std::string value = Text(path, model, "distortion_model");
    if (value == "equidistant" || value == "fisheye")
      camera.model = Camera::Model::kFisheye;
    else if (value != "plumb_bob" && value != "radtan") {
      Fail(path, "key distortion_model is \"" + value + "\"; known are plumb_bob, radtan, equidistant, fisheye");
    }
  }
  const auto coefficients = data("distortion_coefficients", 4);
  const size_t count = camera.model == Camera::Model::kFisheye ? 4 : std::min<size_t>(5, coefficients.size());
  for (size_t i = 0; i < coefficients.size(); ++i) {
    if (i < count)
      camera.distortion[i] = coefficients[i];
    else if (coefficients[i] != 0)
      Fail(path, "key distortion_coefficients.data has more than " + std::to_string(count) +
                     " coefficients; the model is not known");
  }
  if (root["image_width"]) camera.width = Size(path, root["image_width"], "image_width");
  if (root["image_height"]) camera.height = Size(path, root["image_height"], "image_height");
  if ((camera.width > 0) != (camera.height > 0)) {
    Fail(path, std::string("key ") + (camera.width > 0 ? "image_height" : "image_width") + " is missing");
  }
  return camera;
}

// COLMAP cameras.txt: the first camera. CAMERA_ID MODEL WIDTH HEIGHT PARAMS...
Camera ReadColmap(const std::string& path, const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos || line[begin] == '#') continue;
    std::istringstream fields(line);
    int id = 0;
    std::string model;
    Camera camera;
    if (!(fields >> id >> model >> camera.width >> camera.height)) break;
    std::vector<double> p;
    for (std::string word; fields >> word;) {
      char* end = nullptr;
      p.push_back(std::strtod(word.c_str(), &end));
      if (end == word.c_str() || *end != '\0' || !std::isfinite(p.back()))
        Fail(path, "parameter \"" + word + "\" is not a number");
    }
    const auto need = [&](size_t size) {
      if (p.size() != size)
        Fail(path,
             "model " + model + " needs " + std::to_string(size) + " parameters, it has " + std::to_string(p.size()));
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
      Fail(path, "camera model " + model +
                     " is not known; known are SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, "
                     "OPENCV, OPENCV_FISHEYE");
    }
    return camera;
  }
  Fail(path,
       "no camera found; expected an ORB-SLAM, Kalibr or OpenCV yaml, or a line of COLMAP's cameras.txt (CAMERA_ID "
       "MODEL WIDTH "
       "HEIGHT PARAMS...)");
}

void CheckCamera(const std::string& path, const Camera& camera) {
  if (camera.fx <= 0 || camera.fy <= 0) Fail(path, "the focal lengths fx and fy must be positive");
  if (camera.width < 0 || camera.height < 0 || camera.width > 65535 || camera.height > 65535) {
    Fail(path, "width and height must be 1 to 65535 pixels");
  }
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
  bool is_map = false, any_orb_slam = false;
  try {
    root = YAML::Load(yaml);
    is_map = root.IsMap();
  } catch (const YAML::Exception& e) {
    if (path.ends_with(".txt"))
      is_map = false;
    else
      Fail(path, std::string("is not YAML: ") + e.what());
  }
  try {
    if (!is_map) {
      camera = ReadColmap(path, text);
    } else if (root["cam0"]) {
      camera = ReadKalibr(path, root["cam0"]);
    } else if (root["camera_matrix"] || root["distortion_coefficients"]) {
      camera = ReadOpenCv(path, root);
    } else {
      for (const auto& entry : root)
        any_orb_slam = any_orb_slam || (entry.first.IsScalar() && entry.first.Scalar().starts_with("Camera"));
      if (!any_orb_slam)
        Fail(path, "none of the keys Camera.fx (ORB-SLAM), cam0 (Kalibr), camera_matrix (OpenCV) is there");
      camera = ReadOrbSlam(path, root);
    }
  } catch (const YAML::Exception& e) {
    Fail(path, e.what());
  }
  CheckCamera(path, camera);
  return camera;
}

}  // namespace mapmend

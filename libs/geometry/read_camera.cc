#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <set>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "libs/geometry/camera_file.h"
#include "libs/geometry/camera_formats/camera_format.h"

namespace mapmend {
namespace {

constexpr size_t kMaxBytes = 64 << 20;  // cameras.bin of half a million photos
constexpr size_t kMaxText = 4 << 20;
constexpr int kMaxNodes = 200000;

struct CameraFormat {
  const char* name;
  bool (*recognise)(const CameraText& file);
  CameraFile (*read)(const CameraText& file);
};

// The first that recognises a file reads it.
constexpr CameraFormat kFormats[] = {
    {"Kalibr camchain", IsKalibr, ReadKalibr},
    {"SVO cameras", IsSvo, ReadSvo},
    {"SVO parameters", IsSvoParameters, ReadSvoParameters},
    {"EuRoC sensor.yaml", IsEuroc, ReadEuroc},
    {"VINS", IsVins, ReadVins},
    {"openvslam or stella_vslam settings", IsStella, ReadStella},
    {"ORB-SLAM settings", IsOrbSlam, ReadOrbSlam},
    {"ROS camera_info", IsCameraInfo, ReadCameraInfo},
    {"OpenCV or ROS calibration", IsOpenCv, ReadOpenCv},
    {"ODM cameras.json", IsOdm, ReadOdm},
    {"OpenREALM calib.yaml", IsOpenRealm, ReadOpenRealm},
    {"COLMAP cameras.bin", IsColmapBinary, ReadColmapBinary},
    {"DSO camera.txt", IsDso, ReadDso},
    {"COLMAP cameras.txt", IsColmapText, ReadColmapText},
};

constexpr char kKnown[] =
    "known are the files of ORB-SLAM, openvslam, stella_vslam, Kalibr, EuRoC, VINS, SVO, DSO, LSD-SLAM, OpenCV, ROS, "
    "COLMAP (cameras.txt, cameras.bin), ODM and OpenREALM";

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text.substr(0, 200);
}

// OpenCV takes the second of two equal keys for an error, YAML libraries the first or the last.
void RefuseTwice(const YAML::Node& node, int depth, int* num_nodes) {
  if (++*num_nodes > kMaxNodes || depth > 50) RefuseCamera("is too large for a camera file");
  if (node.IsSequence()) {
    for (const auto& entry : node) RefuseTwice(entry, depth + 1, num_nodes);
  } else if (node.IsMap()) {
    std::set<std::string> keys;
    for (const auto& entry : node) {
      if (entry.first.IsScalar() && !keys.insert(entry.first.Scalar()).second)
        RefuseCamera("key " + entry.first.Scalar() + " is there twice");
      RefuseTwice(entry.second, depth + 1, num_nodes);
    }
  }
}

YAML::Node FromOpenCv(const cv::FileNode& from, int depth) {
  if (depth > 20) RefuseCamera("is too deep for a camera file");
  YAML::Node node;
  if (from.isMap()) {
    for (const cv::FileNode& child : from) node[child.name()] = FromOpenCv(child, depth + 1);
  } else if (from.isSeq()) {
    for (const cv::FileNode& child : from) node.push_back(FromOpenCv(child, depth + 1));
  } else if (from.isInt()) {
    node = static_cast<int>(from);
  } else if (from.isReal()) {
    node = static_cast<double>(from);
  } else if (from.isString()) {
    node = static_cast<std::string>(from);
  }
  return node;
}

YAML::Node ParseXml(const std::string& text) {
  if (text.find("<opencv_storage") == std::string::npos) {
    RefuseCamera(text.find("<calibration") != std::string::npos
                     ? "is an XML file of Metashape; export the calibration in OpenCV's format"
                     : "is XML, but not of OpenCV (no opencv_storage)");
  }
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try {
    const cv::FileStorage storage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_XML);
    if (!storage.isOpened()) RefuseCamera("is damaged XML");
    return FromOpenCv(storage.root(), 0);
  } catch (const cv::Exception& e) {
    RefuseCamera("is damaged XML: " + OneLine(e.err));
  }
}

// The keys of the file; no node if it is no YAML or a plain text in it.
YAML::Node ParseKeys(const std::string& bytes, std::string* problem) {
  std::string text = bytes;
  const size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string::npos) return {};
  if (text[begin] == '<') return ParseXml(text);
  if (text[begin] == '{' || text[begin] == '[') {
    // JSON may be indented with tabs, YAML not.
    if (nlohmann::json::accept(text)) std::replace(text.begin(), text.end(), '\t', ' ');
  } else if (text.compare(begin, 5, "%YAML") == 0) {
    // "%YAML:1.0", as OpenCV writes it, is not YAML.
    text.erase(0, std::min(text.find('\n', begin), text.size()));
  }
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& e) {
    *problem = std::string("is not YAML: ") + OneLine(e.what());
    return {};
  }
}

[[noreturn]] void RefuseUnknown(const CameraText& file, const std::string& problem) {
  if (file.yaml.IsMap()) {
    const CameraKeys keys(file.yaml, "");
    if (keys.Has("value0"))
      RefuseCamera("is a calibration of Basalt, which is not read; convert it to Kalibr's format");
    if (keys.Has("cameras"))
      RefuseCamera(
          "key cameras holds no camera as SVO writes it (OKVIS files are not read); convert it to Kalibr's format");
    RefuseCamera(std::string("none of the keys of a camera file is there; ") + kKnown);
  }
  if (!problem.empty()) RefuseCamera(problem);
  RefuseCamera(std::string("no camera found; ") + kKnown);
}

void CheckModel(const Camera& camera) {
  using enum Camera::Model;
  const auto& d = camera.distortion;
  const auto require = [](bool good, const char* what) {
    if (!good) RefuseCamera(what);
  };
  if (camera.model == kFov) require(d[0] > 0 && d[0] < 3.14, "the angle of the FOV model must be 0 to 3.14 radians");
  if (camera.model == kOmni) require(d[0] >= 0, "xi of the omni model must not be negative");
  if (camera.model == kDoubleSphere)
    require(d[0] > -1 && d[0] <= 1 && d[1] >= 0 && d[1] <= 1,
            "xi and alpha of the ds model must be -1 to 1 and 0 to 1");
  if (camera.model == kExtendedUnified)
    require(d[0] >= 0 && d[0] <= 1 && d[1] > 0, "alpha and beta of the eucm model must be 0 to 1 and positive");
}

void CheckCamera(const Camera& camera) {
  if (!(camera.fx > 0 && camera.fy > 0)) RefuseCamera("the focal lengths fx and fy must be positive");
  if (camera.width < 0 || camera.height < 0 || camera.width > 65535 || camera.height > 65535)
    RefuseCamera("width and height must be 1 to 65535 pixels");
  if (camera.fx < 10 && camera.cx <= 2 && camera.cy <= 2) {
    char text[200];
    std::snprintf(text, sizeof(text),
                  "the intrinsics are normalised (fx %g, cx %g); multiply fx and cx by the width, fy and cy by the "
                  "height of the images",
                  camera.fx, camera.cx);
    RefuseCamera(text);
  }
  if (camera.width > 0 && (camera.cx < 0 || camera.cx > camera.width)) RefuseCamera("cx lies outside the image");
  if (camera.height > 0 && (camera.cy < 0 || camera.cy > camera.height)) RefuseCamera("cy lies outside the image");
  CheckModel(camera);
}

}  // namespace

CameraFile ReadCameraFile(const std::string& path, int image_width, int image_height) {
  CameraText file;
  file.path = path;
  file.image_width = image_width;
  file.image_height = image_height;
  std::string format;
  try {
    file.bytes = ReadFile(path);
  } catch (const std::runtime_error&) {
    throw std::runtime_error("camera file " + path + ": cannot be read");
  }
  try {
    std::string problem;
    if (file.bytes.size() > kMaxBytes) RefuseCamera("is too large for a camera file");
    if (file.bytes.starts_with("\xEF\xBB\xBF")) file.bytes.erase(0, 3);
    if (file.bytes.starts_with("\xFF\xFE") || file.bytes.starts_with("\xFE\xFF"))
      RefuseCamera("is UTF-16 text; save it as UTF-8");
    if (file.bytes.find('\0') == std::string::npos) {
      if (file.bytes.size() > kMaxText) RefuseCamera("is too large for a camera file");
      if (file.bytes.find('\n') == std::string::npos) std::replace(file.bytes.begin(), file.bytes.end(), '\r', '\n');
      file.yaml.reset(ParseKeys(file.bytes, &problem));
      int num_nodes = 0;
      RefuseTwice(file.yaml, 0, &num_nodes);
    }
    for (const CameraFormat& known : kFormats) {
      if (!known.recognise(file)) continue;
      format = known.name;
      CameraFile result = known.read(file);
      result.format = format;
      CheckCamera(result.camera);
      for (std::string& note : result.notes) note = "camera " + path + ": " + note;
      return result;
    }
    RefuseUnknown(file, problem);
  } catch (const std::exception& e) {
    throw std::runtime_error("camera file " + path + ": " + OneLine(e.what()) +
                             (format.empty() ? "" : " (" + format + ")"));
  }
}

Camera ReadCamera(const std::string& path) { return ReadCameraFile(path).camera; }

}  // namespace mapmend

#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "libs/geometry/camera_file.h"

// What the readers of the single formats share. Each format is two functions: one that recognises a file, one that
// reads it. Errors are std::runtime_error with what is wrong; ReadCameraFile adds the names of the file and the format.
namespace mapmend {

// A file before anybody knows its format.
struct CameraText {
  std::string path;
  std::string bytes;
  YAML::Node yaml;                        // defined if the file is YAML, JSON, or OpenCV's XML, and holds keys
  int image_width = 0, image_height = 0;  // of the images to be mapped; 0 if unknown
};

// The keys of one map of a file, with the name of the map for messages.
class CameraKeys {
 public:
  CameraKeys(const YAML::Node& map, std::string prefix);

  bool Has(const std::string& key) const;
  // The first of the keys that is there; the first of all if none is.
  std::string FirstOf(const std::vector<std::string>& keys) const;
  double Number(const std::string& key) const;
  double NumberOr(const std::string& key, double fallback) const;
  std::string Word(const std::string& key) const;
  int Pixels(const std::string& key) const;  // 1 to 65535
  // A list, a list of lists, or OpenCV's and ROS's matrix with "data", row by row.
  std::vector<double> Numbers(const std::string& key) const;
  std::vector<double> Numbers(const std::string& key, size_t count) const;
  CameraKeys Sub(const std::string& key) const;  // that holds keys itself

  // fx fy cx cy from keys of these names.
  void ReadIntrinsics(const std::string& prefix, Camera* camera) const;
  // Width and height, both or none.
  void ReadSize(const std::string& width, const std::string& height, Camera* camera) const;
  std::string Named(const std::string& key) const { return "key " + prefix_ + key; }

 private:
  YAML::Node Get(const std::string& key) const;

  YAML::Node map_;
  std::string prefix_;
};

[[noreturn]] void RefuseCamera(const std::string& what);

// Sets fx fy cx cy from four numbers.
void SetIntrinsics(const std::vector<double>& values, Camera* camera);
// Sets model and coefficients from a list as OpenCV orders it: none, 4, 5, 8, 12 or 14 (k1 k2 p1 p2 k3 k4 k5 k6 ...).
// what: the key, for the message.
void SetOpenCvDistortion(const std::vector<double>& values, const std::string& what, Camera* camera);
// Sets model and coefficients from exactly as many as the fisheye model has.
void SetFisheyeDistortion(const std::vector<double>& values, const std::string& what, Camera* camera);
// The distortion of a file that names it: radtan, equidistant, fov, none and what else they are called.
//   name_key, values_key  of the two, for messages
void SetNamedDistortion(const std::string& name, const std::vector<double>& values, const std::string& name_key,
                        const std::string& values_key, Camera* camera);

// The formats, in files of their own.
bool IsOrbSlam(const CameraText& file);
CameraFile ReadOrbSlam(const CameraText& file);
bool IsStella(const CameraText& file);
CameraFile ReadStella(const CameraText& file);
bool IsKalibr(const CameraText& file);
CameraFile ReadKalibr(const CameraText& file);
bool IsEuroc(const CameraText& file);
CameraFile ReadEuroc(const CameraText& file);
bool IsVins(const CameraText& file);
CameraFile ReadVins(const CameraText& file);
bool IsSvo(const CameraText& file);
CameraFile ReadSvo(const CameraText& file);
bool IsSvoParameters(const CameraText& file);
CameraFile ReadSvoParameters(const CameraText& file);
bool IsOpenRealm(const CameraText& file);
CameraFile ReadOpenRealm(const CameraText& file);
bool IsCameraInfo(const CameraText& file);
CameraFile ReadCameraInfo(const CameraText& file);
bool IsOpenCv(const CameraText& file);
CameraFile ReadOpenCv(const CameraText& file);
bool IsOdm(const CameraText& file);
CameraFile ReadOdm(const CameraText& file);
bool IsColmapText(const CameraText& file);
CameraFile ReadColmapText(const CameraText& file);
bool IsColmapBinary(const CameraText& file);
CameraFile ReadColmapBinary(const CameraText& file);
bool IsDso(const CameraText& file);
CameraFile ReadDso(const CameraText& file);

}  // namespace mapmend

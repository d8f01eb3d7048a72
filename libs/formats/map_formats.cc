#include "libs/formats/map_formats.h"

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "libs/base/nearest_word.h"
#include "libs/base/write_file.h"
#include "libs/command_line/command_line.h"
#include "libs/formats/g2o.h"
#include "libs/formats/gltf.h"
#include "libs/formats/las.h"
#include "libs/formats/map_mcap.h"
#include "libs/formats/trajectory_formats.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

const MapFormat* Find(const std::string& name) {
  const auto& all = MapFormats();
  const auto it = std::find_if(all.begin(), all.end(), [&](const MapFormat& format) { return format.name == name; });
  return it == all.end() ? nullptr : &*it;
}

[[noreturn]] void RefuseFormat(const std::string& name) {
  std::vector<std::string> names;
  std::string list;
  for (const MapFormat& format : MapFormats()) {
    names.push_back(format.name);
    list += (list.empty() ? "" : ", ") + format.name;
  }
  const std::string near = NearestWord(name, names);
  throw UsageError("--format: no format '" + name + "'" + (near.empty() ? "" : "; did you mean " + near + "?") +
                   " (there are " + list + ")");
}

std::string Mcap(const PlacedMap& map) {
  std::ostringstream stream;
  WriteMcap(map, &stream);
  return std::move(stream).str();
}

}  // namespace

const std::vector<MapFormat>& MapFormats() {
  static const std::vector<MapFormat> formats = {
      {"tum", {"frames.tum", "keyframes.tum"}, "trajectories (evo and others)", true},
      {"ply", {"map.ply", "cameras.ply"}, "points and camera path (CloudCompare, MeshLab, Blender)", true},
      {"colmap", {"colmap"}, "keyframes, features and points as a COLMAP model", true},
      {"kitti", {"frames.kitti.txt", "frames.kitti.times.txt"}, "trajectory of KITTI's odometry benchmark"},
      {"euroc", {"frames.euroc.csv"}, "trajectory as the EuRoC data set has it"},
      {"las", {"map.las"}, "points as LAS 1.4 (GIS, CloudCompare, PDAL)"},
      {"g2o", {"graph.g2o"}, "pose graph of the keyframes (g2o, GTSAM, Ceres)"},
      {"gltf", {"map.glb"}, "points, cameras and graph as glTF 2.0 (Blender, browsers)"},
      {"mcap", {"map.mcap"}, "trajectory, points, graph and losses for Foxglove"},
  };
  return formats;
}

std::vector<std::string> ParseFormats(const std::vector<std::string>& texts) {
  std::vector<std::string> names;
  for (const std::string& text : texts) {
    std::istringstream stream(text);
    for (std::string name; std::getline(stream, name, ',');) {
      if (Find(name) == nullptr) RefuseFormat(name);
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

bool IsAlwaysWritten(const std::string& format) { return Find(format)->is_always_written; }

const std::vector<std::string>& FrameNames() {
  static const std::vector<std::string> names = {"map", "level", "enu", "utm"};
  return names;
}

std::vector<std::string> FormatsIn(const std::string& folder) {
  std::vector<std::string> names;
  for (const MapFormat& format : MapFormats()) {
    std::error_code ignored;
    const auto is_there = [&](const std::string& file) { return fs::exists(fs::path(folder) / file, ignored); };
    if (!format.is_always_written && std::all_of(format.files.begin(), format.files.end(), is_there))
      names.push_back(format.name);
  }
  return names;
}

void WriteFormat(const std::string& name, const PlacedMap& map, const std::string& folder) {
  const auto write = [&](const std::string& file, const std::string& content) {
    WriteFile((fs::path(folder) / file).string(), content);
  };
  const std::vector<std::string>& files = Find(name)->files;
  if (name == "kitti") {
    write(files[0], KittiPoses(map));
    write(files[1], KittiTimes(map));
  } else if (name == "euroc") {
    write(files[0], EurocCsv(map));
  } else if (name == "las") {
    write(files[0], PointsLas(map));
  } else if (name == "g2o") {
    write(files[0], PoseGraphG2o(map));
  } else if (name == "gltf") {
    write(files[0], MapGlb(map));
  } else if (name == "mcap") {
    write(files[0], Mcap(map));
  }
}

}  // namespace mapmend

#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"

// One component of a finished map in a frame that was chosen for it, as files of other programs want it. Plain numbers
// and words: who fills it in knows the map, who writes it knows the format.
namespace mapmend {

// The frame and unit of all coordinates of a PlacedMap.
struct FrameOfReference {
  std::string name = "map";        // "map", "level", "enu", "utm"
  std::string unit = "map units";  // "m" if lengths mean something
  std::string note;                // one sentence for a person: where the frame comes from, what is arbitrary
  bool is_z_up = false;            // false: as the first camera was held, x to the right, y down, z forward
  int epsg = 0;                    // code of the coordinate reference system; 0: none
  // What must be added to the coordinates to have those of the reference system, which may be too large for a float.
  // Formats with numbers of 64 bits do so, the others (PLY, glTF, MCAP) leave it to who reads them, and say it.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
};

// One sentence: name, note and unit of a frame, and what to add to the coordinates, if anything.
std::string Describe(const FrameOfReference& frame);

using Rgb = std::array<uint8_t, 3>;

struct PlacedSubmap {
  int number = 0;  // for people
  Rgb color = {};  // that tells it from the others
};

struct PlacedPose {
  int64_t utime = 0;
  int session = 0;  // index into PlacedMap::cameras
  int submap = 0;   // index into PlacedMap::submaps
  int frame = -1;   // of the session's input
  Rigid3 world_from_camera;
};

struct PlacedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Rgb color = {};
  int submap = 0;
  int num_images = 0;  // keyframes that see it
};

// A relation that was measured between two keyframes, in the unit of the map.
struct PlacedRelation {
  enum class Kind { kTracked, kTree, kConnection, kLoop };
  Kind kind = Kind::kTracked;
  int a = 0, b = 0;  // indices into PlacedMap::keyframes
  Rigid3 a_from_b;
  // Standard deviations: radians, map units.
  double sigma_rotation = 1, sigma_translation = 1;
};

struct PlacedLoss {
  int64_t utime = 0;
  std::string text;  // one sentence
};

struct PlacedMap {
  std::string title;
  FrameOfReference frame;
  std::vector<Pinhole> cameras;  // ideal ones, a session each
  std::vector<PlacedSubmap> submaps;
  std::vector<PlacedPose> frames, keyframes;  // ascending by time
  std::vector<PlacedPoint> points;
  std::vector<PlacedRelation> relations;
  std::vector<PlacedLoss> losses;  // ascending by time
};

}  // namespace mapmend

#pragma once

#include <memory>
#include <vector>

#include "tools/simulate/material.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// What covers a block of land between the roads.
enum class Land { kHouses, kPark, kFields, kMarsh, kForest };

struct Lake {
  double x = 0, y = 0, radius_x = 0, radius_y = 0, yaw = 0;
};

// A square of land that looks the same a second time: ground, plants, light and shade, on the hills that are there.
// Houses and cars are not copied.
struct Twin {
  double from_x = 0, from_y = 0, to_x = 0, to_y = 0;  // the corners with the least coordinates
  double size = 0;                                    // 0: there is none
};

struct AerialOptions {
  uint64_t seed = 1;
  double x0 = 0, y0 = 0, width = 400, length = 400;  // metres: the area that is modelled
  double texel = 0.12;                               // ground texture, metres
  double spacing = 0.5;                              // of the height grid, metres
  double relief = 8;                                 // hills, metres from low to high about
  double road_spacing = 110;
  // Shares of the blocks.
  double houses = 3, park = 2, fields = 2, marsh = 1, forest = 1;
  double trees = 1;      // how many, as a multiple of the usual
  double foliage = 0.5;  // contrast of single leaves and blades, which change with the direction of view, at most 0.9
  double leaf_angle = 0.8, leaf_time = 30;  // how long one is seen: tangent of a direction, seconds of wind
  double grain = 0.35;                      // contrast of the ground's finest pattern
  double roughness =
      0;  // of reed, crops and undergrowth, metres: real relief, with light and shade, and slower to render
  std::vector<Lake> lakes;
  // If positive, the land repeats itself exactly with this period along x: perceptual aliasing on purpose.
  double repeat_x = 0;
  Twin twin;
  int num_threads = 1;
};

struct Tree {
  double x = 0, y = 0, radius = 3, height = 6;
  uint64_t seed = 0;
};

// Something flat and rectangular painted on the ground.
struct Pad {
  enum class Kind { kYard, kDriveway, kPool, kCourt, kFence, kPath };
  Kind kind = Kind::kYard;
  double x = 0, y = 0, half_x = 1, half_y = 1, yaw = 0;
  uint64_t seed = 0;
};

struct House {
  double x = 0, y = 0, size_x = 12, size_y = 9, wall = 3, roof = 2, yaw = 0;
  uint64_t seed = 0;
};

struct Car {
  double x = 0, y = 0, yaw = 0;
  uint64_t seed = 0;
};

// Where everything stands, in the plane. A pure function of the options.
class AerialLayout {
 public:
  explicit AerialLayout(const AerialOptions& options);

  // Roads, blocks and ground cover are functions of the place.
  struct Place {
    double u = 0, v = 0;  // coordinates along the bent road grid, metres
    double road = 0;      // distance to the middle of the nearest road, metres
    double along = 0;     // position along it
    uint64_t road_seed = 0;
    bool crossing = false;
    int64_t block_x = 0, block_y = 0;
    Land land = Land::kPark;
    uint64_t seed = 0;  // of the block
  };
  Place At(double x, double y) const;
  double Hills(double x, double y) const;  // height without trees and lakes
  // Below 1 inside the lake; the shore is irregular.
  double LakeDistance(const Lake& lake, double x, double y) const;

  const AerialOptions& Options() const { return options_; }

  std::vector<Tree> trees;
  std::vector<Pad> pads;
  std::vector<House> houses;
  std::vector<Car> cars;

 private:
  void Warp(double x, double y, double* u, double* v) const;
  void FillBlock(int64_t i, int64_t j);
  void FillHouses(int64_t i, int64_t j, uint64_t seed);
  void FillPark(int64_t i, int64_t j, uint64_t seed);
  void AddTree(double u, double v, double radius, double height, uint64_t seed);
  bool ToWorld(double u, double v, double* x, double* y, double* yaw) const;
  Land LandOf(int64_t i, int64_t j) const;
  bool Free(double x, double y, double radius) const;

  AerialOptions options_;
};

// Terrain with texture, light and shadows, houses, cars and trees.
std::unique_ptr<Scene> BuildAerialScene(const AerialOptions& options, const MaterialLibrary& materials);

// The ground's colour without light, before pads and trees.
Color GroundCover(const AerialLayout& layout, const MaterialLibrary& materials, double x, double y);
// Paints pads and trees over the ground in rows [begin, end) of the image.
void PaintPads(const AerialLayout& layout, const MaterialLibrary& materials, int begin, int end, Image* image);
void PaintTrees(const AerialLayout& layout, const MaterialLibrary& materials, int begin, int end, Image* image);
// The shape of a tree: a dome and a dozen smaller domes on it.
class Crown {
 public:
  explicit Crown(const Tree& tree);
  double Height(double x, double y) const;  // above the ground, 0 outside

 private:
  struct Dome {
    double x, y, size, base;
  };
  Tree tree_;
  std::vector<Dome> domes_;
};

}  // namespace mapmend::simulate

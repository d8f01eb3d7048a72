#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "tools/simulate/canopy.h"
#include "tools/simulate/texture.h"

namespace mapmend::simulate {

// World: metres, x east, y north, z up.

// Heights on a square grid; between the vertices two triangles per cell, cut from (i + 1, j) to (i, j + 1). Vertex (i,
// j) lies at (x0 + i * spacing, y0 + j * spacing).
struct HeightGrid {
  double x0 = 0, y0 = 0, spacing = 1;
  int width = 0, height = 0;  // vertices
  BigVector<float> z;

  float& At(int i, int j) { return z[static_cast<size_t>(j) * width + i]; }
  float At(int i, int j) const { return z[static_cast<size_t>(j) * width + i]; }
  // On the triangles; clamped to the border.
  double Height(double x, double y) const { return Tangent(x, y).z(); }
  // The slopes along x and y there, and the height.
  Eigen::Vector3d Tangent(double x, double y) const;
};

// A plane of a convex solid: normal . x = offset, normal pointing out; and how its picture lies on it: texel
// (u . x + u0, v . x + v0). texture < 0: the face has the plain colour.
struct Face {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0;
  int texture = -1;
  Eigen::Vector3d u = Eigen::Vector3d::Zero(), v = Eigen::Vector3d::Zero();
  double u0 = 0, v0 = 0;
  float texels_per_metre = 1;
  Color color = {};  // multiplies the texture (1 = as it is), or is the plain colour ([0, 255])
};

// The intersection of at most eight half-spaces: a house, a car body, a table top, a wall.
struct Solid {
  std::vector<Face> faces;
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero();  // bounding box
};

struct Hit {
  static constexpr int kNothing = -1, kGround = 0;  // 1 + 8 * solid + face otherwise

  double distance = 0;  // along the ray, metres for a unit direction
  int surface = kNothing;
  float slope = 0;  // of the ground: tangent of its steepness
};

// A bundle of rays seen steeply from above: nothing is in it above this height, and, where `solids` is false, no solid
// lies in the blocks of the grid in which its rays pass that height.
struct Beam {
  double height = 1e30;
  bool solids = true;
};

// Below the size of a texel: ever finer copies of a grey picture, each fading in as the camera comes near.
struct DetailLook {
  static constexpr double kFirst = 2.7, kGrowth = 3.1;  // texels of the picture per texel of the ground
  static constexpr int kCopies = 4;
  // How much of a copy is seen by a pixel that covers `width` texels of the ground; nothing below 0.
  static constexpr double kFading = 0.7;  // 1 - kFading * width * copy

  const Texture* texture = nullptr;  // mean 128, repeated; null for none
  int last_level = 0;
  float contrast = 0;                 // per grey level
  double origin_u = 0, origin_v = 0;  // texels of the ground from here on
};

// A textured height field with convex solids on it. Immutable after Build; safe to share between threads.
class Scene {
 public:
  HeightGrid grid;
  std::shared_ptr<const Texture> ground;  // row 0 in the south; light and shadow are in it already
  // The alpha of the ground is how much of it is vegetation, whose brightness changes with the direction of view by up
  // to `foliage`, a part of itself; a leaf is seen over `leaf_angle` (tangent) and for leaf_time seconds.
  float foliage = 0;
  double ground_repeat = 0;  // if positive, leaves repeat themselves along x with this period, texels
  double leaf_angle = 0.8, leaf_time = 30;
  double ground_texels_per_metre = 1;     // texel (0, 0) has its centre half a texel inside the corner (x0, y0)
  float ground_detail = 0;                // contrast of the detail that appears below the texel size
  std::shared_ptr<const Texture> detail;  // grey, mean 128, repeated
  std::vector<Solid> solids;
  std::vector<std::shared_ptr<const Texture>> textures;
  double survey_height = 500;  // above everything; indoors, below the ceiling
  // Beyond its borders the ground goes on, as a mirrored picture on the plane z = 0 that fades into the haze: for views
  // far to the side, not part of the truth.
  bool continues = false;
  Color sky_low = Rgb(205, 215, 228), sky_high = Rgb(120, 165, 220);

  // Call after the public members are set, and once.
  void Build();
  // True if the ground has the same height everywhere.
  bool IsLevel() const { return level_; }
  // First surface on origin + distance * direction, distance > 0. direction has unit length.
  Hit Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    return Cast(origin, direction, Beam{});
  }
  // The same for a ray within a beam whose upper part is known to be empty.
  Hit Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Beam& beam) const;
  // The same for up to eight rays of a beam, to within rounding to single precision.
  void CastEight(const Eigen::Vector3d* origins, const Eigen::Vector3d* directions, int count, const Beam& beam,
                 Hit* hits) const;
  // What is sure to be empty between four rays, the corners of a small piece of the image. All Beam{} promises is
  // nothing. within: a beam of which this one is a part.
  Beam ClearBeam(const Eigen::Vector3d* origins, const Eigen::Vector3d* directions, const Beam& within = {}) const;
  // True if the beam's rays, which hit `surface` (the ground or a face) at four points, must hit it everywhere between:
  // nothing else reaches into the beam. The ground may still be uneven by 0.4 m.
  bool IsClear(const Beam& beam, const Eigen::Vector3d* points, const Eigen::Vector3d* directions, int surface) const;
  // True if all the ground around four points of it (corners in the order of a Z) is one plane to within `tolerance`,
  // metres of height.
  bool IsFlat(const Eigen::Vector3d* points, double tolerance) const;
  // Moves a hit that is nearly right onto the ground, along its ray. False if it was not near enough.
  bool SettleOnGround(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit* hit) const;
  // Colour there, [0, 255] as a camera without noise would store it. pixel_angle: radians between neighbouring rays.
  // time: seconds, for the wind in the leaves.
  Color Shade(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Hit& hit, double pixel_angle,
              double time = 0) const;

  // For texels of the ground from (u, v) on; there is detail.
  DetailLook Detail(double u, double v) const;
  Color ShadeGround(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double footprint, double slope,
                    double time) const;
  CanopyView LeavesSeen(const Eigen::Vector3d& direction, double time) const {
    const double down = 1 / std::max(0.2, -direction.z());
    return CanopyView::From(direction.x() * down, direction.y() * down, leaf_angle,
                            static_cast<int32_t>(time / leaf_time * 1024));
  }

 private:
  struct Level {
    int width = 0, height = 0;
    BigVector<float> max;
  };
  struct Plane {
    double x, y, z, offset;
  };
  // Cells first to last, both included, in x and in y.
  struct Cells {
    int x0, x1, y0, y1;
  };

  // Four rays by height: (x + (height - z) * slope_x, y + (height - z) * slope_y).
  struct Fan {
    Fan(const Eigen::Vector3d* points, const Eigen::Vector3d* directions);
    double x[4], y[4], z[4], slope_x[4], slope_y[4];
  };

  // The blocks of 2^level cells that the rays pass between the heights low and high.
  Cells CellsBetween(double low, double high, const Fan& fan, int level) const;
  static float Greatest(const Level& level, const Cells& cells);
  // Of the ground, cell by cell.
  Level HighestOfCells() const;
  // Half as many blocks each way.
  static Level Halved(const Level& fine);
  // The level, of blocks so wide (metres), is at least as high as the solid where that stands; visit, unless null, gets
  // the index of each block there.
  void Raise(const Solid& solid, double block, Level* level, const std::function<void(size_t)>& visit) const;
  void AddPlanes(const Solid& solid);

  // A ray in cells of the grid, so that cell borders are integers; heights in metres.
  struct GridRay {
    double ox, oy, oz, dx, dy, dz;
  };
  // Where the ray crosses the two triangles of a cell from above, between t and t_out.
  void CastCell(int i, int j, const GridRay& ray, double t, double t_out, Hit* best) const;
  // A steep ray, cell by cell from the beam's height down. False if it leaves the grid.
  bool CastDown(const GridRay& ray, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Beam& beam,
                Hit* best) const;
  void CastSolid(int solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit* best) const;

  static constexpr int kLeaf = 3;  // solids are listed per block of 2^3 cells
  std::vector<Level> levels_;      // greatest height of blocks of cells; solids count from kLeaf upwards
  Level obstacles_;                // of single cells, with solids
  std::vector<uint32_t> list_begin_;
  std::vector<int> lists_;
  std::vector<Plane> planes_;  // 8 per solid, unused ones never cut
  std::vector<int> num_planes_;
  bool level_ = false;
};

// A box standing on the ground, turned by yaw (radians) about its vertical axis. Faces: +x, -x, +y, -y, top, bottom.
Solid MakeBox(const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw);
// The same with a gabled roof of roof_height on top, the ridge along its x axis. Faces: +x, -x, +y, -y, roof +y, roof
// -y.
Solid MakeHouse(const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw, double roof_height);
// Lays a texture on a face: its corner (0, 0) at origin, u and v axes along the (unit) directions.
void LayTexture(Face* face, int texture, const Eigen::Vector3d& origin, const Eigen::Vector3d& u,
                const Eigen::Vector3d& v, double texels_per_metre);

}  // namespace mapmend::simulate

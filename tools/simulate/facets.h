#pragma once

#include <vector>

#include "libs/geometry/rigid3.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// Streets and rooms, level ground with convex solids, are drawn without casting rays: along the ray (x, y, 1) of a
// camera each plane is met at an inverse depth that is linear in x and y (Olano and Greer, Triangle Scan Conversion
// Using 2D Homogeneous Coordinates, 1997). A convex solid is seen where the smallest inverse depth of its planes that
// face the camera is above the largest of the others, and of two solids the one of greater inverse depth is nearer.

// A function that is linear in a ray (x, y, 1) of the first row of a tile, and how its coefficients (the fourth is not
// used) change from row to row, by the rolling shutter.
struct RayLinear {
  Color at, step;

  Color AtRow(float row) const { return at + step * row; }
};

struct FacetPlane {
  RayLinear inverse;  // depth
  int surface;        // as Hit::surface
};

// How a plane that faces the camera looks.
struct FacetLook {
  const Texture* texture;          // null: the tint is all
  Color tint;                      // multiplies the texture
  RayLinear u, v;                  // texel times inverse depth
  RayLinear along_u, along_v;      // texels per metre of depth along the ray
  float texels_per_metre, height;  // height: of the camera above the plane, metres
  int last_level;                  // the coarsest mipmap of two texels or more
};

struct FacetSolid {
  int first, num_front, num_planes;  // the planes that face the camera come first
  float x0, y0, x1, y1;              // where it may be seen, on the plane z = 1
};

// Colour of what is nothing, and how wide a pixel is.
struct FacetSky {
  float pixel_angle;
  Color low, high;
  RayLinear up;  // height gained per depth
};

// All that one row of tiles may show.
class FacetRow {
 public:
  // Part of the plane z = 1.
  struct Bounds {
    float x0, y0, x1, y1;
  };
  // What is seen of a solid in a tile.
  struct Seen {
    bool any, whole;  // whole: in all of the tile
    int plane;        // if only this one can be seen, else -1
    float low, high;  // bounds of its inverse depth; low counts only if whole
  };

  // True if all the scene is of this kind and the camera is where its ground looks the same, above it.
  static bool Serves(const Scene& scene, const Eigen::Vector3d& center);
  // world_from_camera of the first row and of the row `rows` below it.
  void Prepare(const Scene& scene, const Rigid3& first, const Rigid3& last, int rows, const Bounds& bounds,
               float pixel_angle);

  const std::vector<FacetSolid>& Solids() const { return solids_; }
  const FacetPlane& Plane(int plane) const { return planes_[plane]; }
  const FacetLook& Look(int plane) const { return looks_[plane]; }
  const FacetSky& Sky() const { return sky_; }
  Seen See(const FacetSolid& solid, const Bounds& tile) const;
  // The planes that four rays of a row meet first, -1 for none, and their inverse depths there.
  Int4 Meet(const uint16_t* solids, int num_solids, float row, const Color& x, const Color& y, Color* inverse) const;

 private:
  struct Pose {
    Eigen::Matrix3d camera_from_world;
    Eigen::Vector3d center;
  };
  void Add(const Scene& scene, int surface, const std::vector<Face>& faces, const Pose* poses);

  std::vector<FacetSolid> solids_;
  std::vector<FacetPlane> planes_;
  std::vector<FacetLook> looks_;  // of planes_; those of planes that face away are not set
  FacetSky sky_;
  int rows_ = 1;
  bool rolling_ = false;
};

}  // namespace mapmend::simulate

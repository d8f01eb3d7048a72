#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "tools/simulate/facets.h"
#include "tools/simulate/row_kernels.h"
#include "tools/simulate/scene.h"

namespace mapmend::simulate {

// world_from_camera at a time in seconds. Camera: x right, y down, z forward.
using PoseFunction = std::function<Rigid3(double)>;

struct RenderOptions {
  // How long a pixel collects light, and how long the shutter takes from the first row to the last; seconds.
  double exposure = 0.002;
  double readout = 0;
  // Mipmap choice: 0 is the sampling limit, negative is sharper (and begins to alias), as a camera that sharpens.
  double lod_bias = -0.4;
  // Share of the light that comes from the air between.
  float haze = 0;
  // Unsharp mask in the camera: how much of the difference to the mean of 3 x 3 pixels is added.
  double sharpening = 0;
  // true: the blur of every pixel along its own motion, from its depth and the poses at begin and end of the exposure.
  // Exact for each surface; where surfaces occlude each other the background behind a moving edge is approximate.
  // false: no blur.
  bool motion_blur = true;
  int num_threads = 1;
};

// Exposure and colour of one frame, and the seed of its noise.
struct SensorState {
  float gain[3] = {1, 1, 1};  // red, green, blue; of the light, not of the stored value
  float noise = 2;            // standard deviation of a stored value, [0, 255]
  float vignetting = 0.2f;    // loss of light in the corners
  uint64_t seed = 0;
};

// A finished picture, blue green red.
struct Frame {
  int width = 0, height = 0;
  std::vector<uint8_t> bgr;
};

// Renders frames of a scene: one ray a pixel and four on edges, then blur, then the sensor. Where a tile of 8 x 8 or 4
// x 4 pixels is sure to show nothing but even ground or one face, rays are cast at its corners only and inverse depth
// is interpolated, as is exact for a plane. A frame depends on nothing but the arguments. Not thread-safe (it owns
// buffers); threads inside do not change the result.
class Renderer {
 public:
  Renderer(const Scene* scene, const Camera& camera, const RenderOptions& options);

  // time: of the middle row, in the middle of its exposure; the pose of the frame is pose(time).
  void Render(const PoseFunction& pose, double time, const SensorState& sensor, Frame* frame);

  // Of the last frame, per pixel: along the ray, metres; infinite for the sky.
  const BigVector<float>& Distances() const { return distance_; }
  // Unit ray of a pixel in the camera.
  Eigen::Vector3d Ray(int x, int y) const;

 private:
  static constexpr int kTile = 8;

  struct Motion {
    float rotation[9], translation[3];
  };
  struct RowPose {
    Eigen::Matrix3d rotation;  // world_from_camera
    Eigen::Vector3d center;
    Motion begin, end;  // camera then from camera at the middle of the exposure
  };

  // Corners: upper left, lower left, upper right, lower right.
  struct PlainTile {
    int x0, y0, x1, y1;  // of the corners
    int x_end, y_end;    // of the pixels to fill
    int surface;
    const Texture* texture;
    Color tint;         // multiplies the texture
    double u[4], v[4];  // texels
    float foliage;      // contrast of leaves, 0 for none
    CanopyView leaves;
    double inverse[4];  // inverse depth: it, and texels times it, are linear in the pixel
    bool near;          // below the size of a texel detail is seen

    // World, times inverse depth, and that, at a place between the corners (0 to 1 across and down).
    //   points  the corners in the world
    Eigen::Vector4d Between(const Eigen::Vector3d* points, double a, double b) const;
  };

  struct TileState {
    Beam beam;
    int surface;               // of the first corner
    bool plain;                // shows nothing but this surface
    bool still;                // moves by less than half a pixel
    int first = 0, count = 0;  // of facet_lists_
  };
  // As RowMotion, at the corners: upper left, lower left, upper right, lower right.
  struct TileMotion {
    Color base[4], slope[4];
    float least, greatest;  // of 1 / distance
  };
  struct Smoothed {
    size_t index;
    Light light;
  };
  struct UnevenTile {
    int x0, y0;
    float slope[kTile][kTile];  // of the ground, by row and column
    WorldRow world[kTile];
  };
  // Pixels whose rays are cast together, at most all of a tile.
  struct Pending {
    int count = 0, x[kTile * kTile], y[kTile * kTile];
    Hit hit[kTile * kTile];
    void Add(int column, int row) { x[count] = column, y[count++] = row; }
  };
  // Rays through every second or fourth pixel of a tile and its right and lower neighbours, by row and column.
  struct TileNodes {
    static constexpr int kMost = kTile / 2 + 1;
    int step = 0;
    Hit hit[kMost][kMost];
    float inverse[kMost][kMost];  // depth
    bool even[kMost][kMost];      // between it and the next ones there is no edge
    // True if the surface bends so little that these nodes are enough.
    bool Smooth() const;
    // Of a row of pixels, between nodes.
    void InverseDepths(int row, float* between) const;
  };

  Eigen::Vector3d Direction(int x, int y) const {
    return rows_[y].rotation * rays_[static_cast<size_t>(y) * camera_.width + x].cast<double>();
  }
  // Pixels i to i + count - 1, in a row of a tile.
  PixelRow PixelsAt(size_t i, int count, int row) {
    return {&plane_x_[i], &plane_y_[i], &ray_stretch_[i],       &distance_[i], &surface_[i],
            &light_[i],   count,        static_cast<float>(row)};
  }
  // The corner of a tile.
  struct Corner {
    int x, y;
    Eigen::Vector3d direction;
    Hit hit;
    bool known;
  };
  void CastTiles(int pair);
  // FillPlainTile between corners, whose rays are cast if they are not known. hits: what they show.
  bool FillBetween(const std::array<Corner*, 4>& corners, int x_end, int y_end, const Beam& beam, Hit* hits);
  // A row of tiles of a scene for which FacetRow serves.
  void DrawFacets(int tile_row);
  void CastPixel(int x, int y, const Beam& beam);
  void CastPending(const Beam& beam, Pending* pending) const;
  void CastTile(int x0, int y0, int x1, int y1, const Beam& beam, const Hit* hits);
  void CastNodes(int x0, int y0, int step, const Beam& beam, const Hit* corners, TileNodes* nodes) const;
  // Fills pixels x0 .. x_end - 1, y0 .. y_end - 1 from the rays of the corners (x0, y0) and (x1, y1) if they show one
  // even surface; false if not.
  bool FillPlainTile(int x0, int y0, int x1, int y1, int x_end, int y_end, const Beam& beam, const Hit* hits);
  // Whether the ground between the corners is a plane, as far as pixels tell. large: only if that shows at once.
  bool IsEvenGround(const PlainTile& tile, const Eigen::Vector3d* points, bool large) const;
  // Pixel by pixel.
  //   view, distance  of the tile's middle
  void ShadePlainTile(const PlainTile& tile, const Eigen::Vector3d* points, const Eigen::Vector3d& view,
                      double distance);
  // The two levels of detail from `first` on. False if the tile is at the texture's border.
  static bool ChooseLevels(const PlainTile& tile, int first, double origin_u, double origin_v, PlainLook* look);
  static void FetchTexels(const PlainTile& tile, const PlainLook& look, int num_levels, double origin_u,
                          double origin_v);
  // The common case, seen steeply from above: one level of detail for the whole tile. False if it is at the texture's
  // border.
  bool PaintPlainTile(const PlainTile& tile, float lod);
  // Colours of a whole tile whose distances and surfaces are known.
  void ShadeTile(const UnevenTile& tile);
  WorldRow WorldOf(int y) const;
  // Whether RowKernels::shade_ground serves for ground seen in this direction: near the horizon leaves differ too much
  // within a tile.
  bool CanShadeRows(const Eigen::Vector3d& view) const;
  // Ground in this direction, so many metres away.
  GroundLook LookOfGround(const Eigen::Vector3d& view, double distance) const;
  void SmoothEdges(int tile_row, std::vector<Smoothed>* smoothed) const;
  // Bit k: pixel x + k of four differs from a neighbour.
  unsigned Edges(int x, int y) const;
  void SmoothPixel(int x, int y, const Beam& beam, std::vector<Smoothed>* smoothed) const;
  void SmoothFacets(int tile_row, std::vector<Smoothed>* smoothed) const;
  // Bit k: pixel x + k of four shows another surface than a neighbour.
  unsigned Borders(int x, int y) const;
  void SmoothFacetPixel(int x, int y, int tile_row, const TileState& tile, std::vector<Smoothed>* smoothed) const;
  // Poses of all rows at this time of the middle one.
  void FindPoses(const PoseFunction& pose);
  // As RowKernels::move_corners, for any camera. The lanes are in turn of the rows y0 and y1.
  void MoveCorners(int y0, int y1, const CornerPoints& points, Color* moved) const;
  // Finds how what a tile shows moves. True if all of it moves by less than half a pixel.
  bool FindMotion(int tile, bool plain);
  // True if the motions of eight pixels from (x, y) on are so alike that they count as one, and stay in the picture.
  bool IsEven(const Color& least, const Color& most, int x, int y) const;
  // Light after motion blur of a piece of a row, which begins and ends with a tile.
  void BlurRow(int y, int begin, int end, Color* blurred) const;
  // Rows [begin, end) of the finished picture.
  void DevelopRows(int begin, int end, const SensorState& sensor, Frame* frame) const;
  // Pixel of a point in the camera, as Camera::Project, in single precision.
  void Project(const Motion& motion, const float* point, float* x, float* y) const;

  const Scene* scene_;
  Camera camera_;
  RenderOptions options_;
  double pixel_angle_ = 0, time_ = 0;
  bool distorted_ = false;
  Lens lens_{};
  BigVector<Eigen::Vector3f> rays_;
  BigVector<float> ray_stretch_;                    // 1 / rays_.z: distance over depth
  BigVector<float> plane_x_, plane_y_;              // of the rays, at z = 1
  std::vector<FacetRow::Bounds> tile_bounds_;       // of those, with half a pixel around
  bool facets_ = false;                             // how this frame is drawn
  std::vector<FacetRow> facet_rows_;                // per row of tiles
  std::vector<std::vector<uint16_t>> facet_lists_;  // solids that may be seen, tile by tile
  std::vector<RowPose> rows_;
  std::vector<CornerMotion> corner_motions_;  // per row of tiles
  BigVector<float> distance_;
  BigVector<int> surface_;
  std::vector<TileState> tiles_;
  std::vector<TileMotion> motions_;              // of tiles that are not still
  std::vector<std::vector<Smoothed>> smoothed_;  // per row of tiles
  BigVector<Light> light_;                       // before blur
  float edge_slope_ = 0;                         // depth that changes faster, metres per pixel and distance, is an edge
};

}  // namespace mapmend::simulate

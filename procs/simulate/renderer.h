#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "procs/simulate/scene.h"

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

// Squares of stored values, proportional to light; rounded to integers.
using Light = uint16_t __attribute__((vector_size(8)));
inline Light PackLight(const Color& stored) {
  const Color light = stored * stored + 0.5f;
#if defined(__SSE4_1__)
  const __m128i whole = _mm_cvttps_epi32(light);
  Light result;
  _mm_storel_epi64(reinterpret_cast<__m128i*>(&result), _mm_packus_epi32(whole, whole));
  return result;
#else
  const auto pack = [](float v) { return static_cast<uint16_t>(std::min(v, 65535.f)); };
  return Light{pack(light[0]), pack(light[1]), pack(light[2]), pack(light[3])};
#endif
}
inline Color UnpackLight(const Light& light) {
#if defined(__SSE4_1__)
  return _mm_cvtepi32_ps(_mm_cvtepu16_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&light))));
#else
  return {static_cast<float>(light[0]), static_cast<float>(light[1]), static_cast<float>(light[2]),
          static_cast<float>(light[3])};
#endif
}

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
  };

  struct TileState {
    Beam beam;
    int surface;  // of the first corner
    bool plain;   // FillPlainTile has filled it
    bool still;
  };
  struct Smoothed {
    size_t index;
    Light light;
  };
  struct UnevenTile {
    int x0, y0;
    float slope[kTile][kTile];  // of the ground, by row and column
  };

  Eigen::Vector3d Direction(int x, int y) const {
    return rows_[y].rotation * rays_[static_cast<size_t>(y) * camera_.width + x].cast<double>();
  }
  void CastTiles(int pair);
  void CastPixel(int x, int y, const Beam& beam);
  void CastTile(int x0, int y0, int x1, int y1, const Beam& beam, const Hit* hits);
  // Fills pixels x0 .. x_end - 1, y0 .. y_end - 1 from the rays of the corners (x0, y0) and (x1, y1) if they show one
  // even surface; false if not.
  bool FillPlainTile(int x0, int y0, int x1, int y1, int x_end, int y_end, const Beam& beam, const Hit* hits);
  // The common case, seen steeply from above: one level of detail for the whole tile. False if it is at the texture's
  // border.
  bool PaintPlainTile(const PlainTile& tile, float lod);
  // Colours of a whole tile whose distances and surfaces are known.
  void ShadeTile(const UnevenTile& tile);
  void SmoothEdges(int tile_row, std::vector<Smoothed>* smoothed) const;
  // Whether any of the pixels x .. x + 3 differs from a neighbour.
  bool HasEdge(int x, int y) const;
  void SmoothPixel(int x, int y, const Beam& beam, std::vector<Smoothed>* smoothed) const;
  // From a pixel's surface point in the middle of the exposure to the same at its beginning (0, 1) and end (2, 3).
  Color MotionOf(int x, int y) const { return MotionOf(x, y, distance_[static_cast<size_t>(y) * camera_.width + x]); }
  Color MotionOf(int x, int y, float distance) const;
  // True if all of a tile moves by less than half a pixel.
  bool IsStill(int x0, int y0, int x_end, int y_end, bool plain) const;
  // Light after motion blur of a piece of a row, which begins and ends with a tile.
  void BlurRow(int y, int begin, int end, Color* blurred) const;
  // Light to stored values, without noise; in place.
  void ExposeRow(int y, int begin, int end, const SensorState& sensor, Color* row) const;
  // Rows [begin, end) of the finished picture.
  void DevelopRows(int begin, int end, const SensorState& sensor, Frame* frame) const;
  // Pixel of a point in the camera, as Camera::Project, in single precision.
  void Project(const Motion& motion, const float* point, float* x, float* y) const;

  const Scene* scene_;
  Camera camera_;
  RenderOptions options_;
  double pixel_angle_ = 0, time_ = 0;
  bool distorted_ = false;
  BigVector<Eigen::Vector3f> rays_;
  BigVector<float> ray_stretch_;  // 1 / rays_.z: distance over depth
  std::vector<RowPose> rows_;
  BigVector<float> distance_;
  BigVector<int> surface_;
  std::vector<TileState> tiles_;
  std::vector<std::vector<Smoothed>> smoothed_;  // per row of tiles
  BigVector<Light> light_;                       // before blur
  float edge_slope_ = 0;                         // depth that changes faster, metres per pixel and distance, is an edge
};

}  // namespace mapmend::simulate

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

// Renders frames of a scene: one ray a pixel and four on edges, then blur, then the sensor. Where a tile of 8 x 8 pixels is sure to
// show nothing but even ground, rays are cast at its corners only and inverse depth is interpolated, as is exact for a plane. A frame depends on
// nothing but the arguments. Not thread-safe (it owns buffers); threads inside do not change the result.
class Renderer {
 public:
  Renderer(const Scene* scene, const Camera& camera, const RenderOptions& options);

  // time: of the middle row, in the middle of its exposure; the pose of the frame is pose(time).
  void Render(const PoseFunction& pose, double time, const SensorState& sensor, Frame* frame);

  // Of the last frame, per pixel: along the ray, metres; infinite for the sky.
  const std::vector<float>& Distances() const { return distance_; }
  // Unit ray of a pixel in the camera.
  Eigen::Vector3d Ray(int x, int y) const;

 private:
  struct Motion {
    float rotation[9], translation[3];
  };
  struct RowPose {
    Eigen::Matrix3d rotation;  // world_from_camera
    Eigen::Vector3d center;
    Motion begin, end;  // camera then from camera at the middle of the exposure
  };

  void CastTiles(int tile_row);
  void CastPixel(int x, int y);
  // Fills a tile of plain ground from its corners' rays; false if it is not plain.
  bool FillPlainTile(int x0, int y0, int x1, int y1, const Hit* hits);
  void SmoothEdges(int y);
  void BlurRow(int y);
  void DevelopRow(int y, const SensorState& sensor, Frame* frame) const;
  // Pixel of a point in the camera, as Camera::Project, in single precision.
  void Project(const Motion& motion, const float* point, float* x, float* y) const;

  const Scene* scene_;
  Camera camera_;
  RenderOptions options_;
  double pixel_angle_ = 0;
  std::vector<Eigen::Vector3f> rays_;
  std::vector<RowPose> rows_;
  std::vector<float> distance_;
  std::vector<int> surface_;
  std::vector<uint8_t> plain_;  // per tile: FillPlainTile has filled it
  std::vector<Color> sharp_, smooth_, blurred_;  // squares of the stored values: proportional to light
};

}  // namespace mapmend::simulate

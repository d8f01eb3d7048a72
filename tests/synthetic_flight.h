#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "libs/geometry/similarity3.h"
#include "libs/stream/records.h"
#include "libs/stream/submap.h"

// Simulated flights as records of the stream, with exact truth: random terrain points with random descriptors, seen by
// nadir cameras; submaps in their own frames and scales. Enough of a world to test connections and merges without
// images.
namespace mapmend::testing {

struct TerrainPoint {
  Eigen::Vector3d position;  // metres, z up, ground near 0
  Descriptor descriptor;
  float angle = 0;  // orientation in an image whose x axis points east
  double size = 0;  // metres: octave 0 where it appears one pixel large
};

struct TerrainOptions {
  double width = 400, height = 400;  // metres, from the origin
  double relief = 4;                 // metres, standard deviation
  int num_points = 16000;
  double min_size = 0.05, max_size = 1.13;  // metres, of the corners
  uint64_t seed = 7;
};
std::vector<TerrainPoint> MakeTerrain(const TerrainOptions& options);
// Copies the texture (not the ground) of a square with corner `from` onto the square with corner `to`: perceptual
// aliasing.
void CopyPatch(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double size, std::vector<TerrainPoint>* terrain);

// world_from_cam of a camera that looks straight down from (x, y, altitude), its image's up pointing to heading (0 =
// north, clockwise), tilted by a little noise if random is given.
Rigid3 NadirPose(double x, double y, double altitude, double heading_deg, std::mt19937_64* random = nullptr);
// Poses along a straight line, evenly spaced.
std::vector<Rigid3> Strip(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double altitude, int count,
                          double heading_deg, std::mt19937_64* random = nullptr);

struct FlightOptions {
  Pinhole camera{500, 500, 320, 240, 640, 480};
  Pyramid pyramid;
  int max_features = 800;
  double pixel_noise = 0.5;
  double bit_noise = 0.06;     // probability that a descriptor bit is flipped
  double wrong_word = 0.1;     // probability that a feature lands in a random word
  int num_clutter = 100;       // features of each image that are seen nowhere else
  double scale_drift = 0;      // per keyframe: the submap's scale grows by this fraction
  double angle_drift_deg = 0;  // per keyframe, about the vertical
  double readout = 0;          // seconds, of a rolling shutter
  bool reads_columns = false;  // not rows
  uint64_t seed = 1;
};

// Builds the stream of one session, submap by submap.
class SyntheticFlight {
 public:
  SyntheticFlight(std::string session, int64_t start_utime, const std::vector<TerrainPoint>& terrain,
                  const FlightOptions& options);

  // One submap seen from these poses (world_from_cam); submap_from_world chooses its frame and scale.
  SubmapId AddSubmap(const std::vector<Rigid3>& world_from_cam, const Similarity3& submap_from_world);
  void End();

  const std::vector<Record>& records() const { return records_; }
  // The whole stream as a model; asserts that every record applies.
  Session Model() const;
  const std::vector<Similarity3>& submap_from_world() const { return submap_from_world_; }
  // Truth by keyframe id.
  const std::vector<Rigid3>& world_from_keyframe() const { return world_from_keyframe_; }

 private:
  struct Seen {
    int terrain = -1;
    Keypoint keypoint;
    Descriptor descriptor;
  };
  // before, after: the poses a second earlier and later.
  std::vector<Seen> Observe(const Rigid3& world_from_cam, const Rigid3& before, const Rigid3& after);
  void Append(int64_t utime, RecordBody body);
  double Uniform();
  double Normal();

  std::string session_;
  int64_t utime_;
  const std::vector<TerrainPoint>& terrain_;
  FlightOptions options_;
  std::mt19937_64 random_;
  std::vector<Record> records_;
  std::vector<Similarity3> submap_from_world_;
  std::vector<Rigid3> world_from_keyframe_;
  int next_keyframe_ = 0, next_point_ = 0, next_frame_ = 0;
};

}  // namespace mapmend::testing

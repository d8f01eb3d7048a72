#include "tests/synthetic_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapmend::testing {
namespace {

constexpr int kNumWords = 4000, kWordsPerNode = 40;

double Uniform01(std::mt19937_64* random) { return static_cast<double>((*random)() >> 11) * 0x1.0p-53; }

double Gauss(std::mt19937_64* random) {
  const double u = std::max(1e-300, Uniform01(random)), v = Uniform01(random);
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * M_PI * v);
}

int WordOf(const Descriptor& d) { return static_cast<int>(d[0] % kNumWords); }

BowVector MakeBow(const std::vector<int32_t>& words) {
  std::map<int32_t, int> counts;
  for (const int32_t w : words) ++counts[w];
  BowVector bow;
  for (const auto& [word, count] : counts) {
    bow.words.push_back(word);
    bow.weights.push_back(static_cast<float>(count) / static_cast<float>(words.size()));
  }
  return bow;
}

}  // namespace

std::vector<TerrainPoint> MakeTerrain(const TerrainOptions& options) {
  std::mt19937_64 random(options.seed);
  std::vector<TerrainPoint> terrain(options.num_points);
  for (TerrainPoint& p : terrain) {
    p.position = {options.width * Uniform01(&random), options.height * Uniform01(&random),
                  options.relief * Gauss(&random)};
    for (uint64_t& bits : p.descriptor) bits = random();
    p.angle = static_cast<float>(2 * M_PI * Uniform01(&random) - M_PI);
    p.size = options.min_size * std::pow(options.max_size / options.min_size, Uniform01(&random));
  }
  return terrain;
}

void CopyPatch(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double size,
               std::vector<TerrainPoint>* terrain) {
  const auto inside = [&](const TerrainPoint& p, const Eigen::Vector2d& corner) {
    const Eigen::Vector2d d = p.position.head<2>() - corner;
    return d.x() >= 0 && d.y() >= 0 && d.x() < size && d.y() < size;
  };
  std::vector<TerrainPoint> copies;
  for (TerrainPoint p : *terrain) {
    if (!inside(p, from)) continue;
    p.position.head<2>() += to - from;
    copies.push_back(p);
  }
  std::erase_if(*terrain, [&](const TerrainPoint& p) { return inside(p, to); });
  terrain->insert(terrain->end(), copies.begin(), copies.end());
}

Rigid3 NadirPose(double x, double y, double altitude, double heading_deg, std::mt19937_64* random) {
  // Camera axes: x right, y down in the image, z into the scene (down). Heading 0: image up = north = +y.
  const double h = heading_deg * M_PI / 180;
  const Eigen::Vector3d up(std::sin(h), std::cos(h), 0), forward(0, 0, -1);
  Eigen::Matrix3d R;
  R.col(1) = -up;
  R.col(2) = forward;
  R.col(0) = R.col(1).cross(R.col(2));
  Eigen::Quaterniond q(R);
  if (random) {
    const double s = 0.02;
    q = q * Eigen::Quaterniond(1, s * Gauss(random), s * Gauss(random), s * Gauss(random)).normalized();
  }
  return {q, Eigen::Vector3d(x, y, altitude)};
}

std::vector<Rigid3> Strip(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double altitude, int count,
                          double heading_deg, std::mt19937_64* random) {
  std::vector<Rigid3> poses;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p = from + (to - from) * (static_cast<double>(i) / std::max(1, count - 1));
    poses.push_back(NadirPose(p.x(), p.y(), altitude, heading_deg, random));
  }
  return poses;
}

SyntheticFlight::SyntheticFlight(std::string session, int64_t start_utime, const std::vector<TerrainPoint>& terrain,
                                 const FlightOptions& options)
    : session_(std::move(session)), utime_(start_utime), terrain_(terrain), options_(options), random_(options.seed) {
  SessionStarted start;
  start.version = "test";
  start.vehicle = "synthetic";
  start.pinhole = options.camera;
  start.pyramid = options.pyramid;
  start.settings_json = "{}";
  Append(utime_, start);
}

double SyntheticFlight::Uniform() { return Uniform01(&random_); }
double SyntheticFlight::Normal() { return Gauss(&random_); }

void SyntheticFlight::Append(int64_t utime, RecordBody body) {
  Record record;
  record.header = {session_, static_cast<int64_t>(records_.size()), utime};
  record.body = std::move(body);
  records_.push_back(std::move(record));
}

std::vector<SyntheticFlight::Seen> SyntheticFlight::Observe(const Rigid3& world_from_cam, const Rigid3& before,
                                                            const Rigid3& after) {
  std::vector<Seen> seen;
  const Rigid3 cam_from_world = world_from_cam.Inverse();
  const Eigen::Vector3d velocity = (after.translation - before.translation) / 2;
  const Eigen::AngleAxisd turn_in_two_seconds(before.rotation.conjugate() * after.rotation);
  // The camera when the line of this pixel was read.
  const auto cam_from_world_at = [&](const Eigen::Vector2d& pixel) {
    const double place =
        options_.reads_columns ? pixel.x() / options_.camera.width : pixel.y() / options_.camera.height;
    const double t = options_.readout * (place - 0.5);
    const Eigen::AngleAxisd turn(t * turn_in_two_seconds.angle() / 2, turn_in_two_seconds.axis());
    return Rigid3(world_from_cam.rotation * Eigen::Quaterniond(turn), world_from_cam.translation + t * velocity)
        .Inverse();
  };
  const Eigen::Matrix3d R = cam_from_world.rotation.toRotationMatrix();
  // Where east points in the image: the turn of every keypoint.
  const float turn = static_cast<float>(std::atan2(R(1, 0), R(0, 0)));
  const double log_factor = std::log(options_.pyramid.scale_factor);
  for (size_t i = 0; i < terrain_.size(); ++i) {
    const Eigen::Vector3d x = cam_from_world * terrain_[i].position;
    if (!(x.z() > 1)) continue;
    Eigen::Vector2d pixel = options_.camera.Project(x);
    for (int step = 0; options_.readout != 0 && step < 4; ++step) {
      pixel = options_.camera.Project(cam_from_world_at(pixel) * terrain_[i].position);
    }
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= options_.camera.width || pixel.y() >= options_.camera.height) {
      continue;
    }
    // A corner is still found one level off its own.
    const int level =
        static_cast<int>(std::lround(std::log(terrain_[i].size * options_.camera.fx / x.z()) / log_factor));
    if (level < -1 || level > options_.pyramid.num_levels) continue;
    const int octave = std::clamp(level, 0, options_.pyramid.num_levels - 1);
    Seen s;
    s.terrain = static_cast<int>(i);
    const double noise = options_.pixel_noise * options_.pyramid.Scale(octave);
    s.keypoint.pixel = (pixel + noise * Eigen::Vector2d(Normal(), Normal())).cast<float>();
    s.keypoint.octave = static_cast<int8_t>(octave);
    s.keypoint.angle = static_cast<float>(std::remainder(terrain_[i].angle + turn + 0.05 * Normal(), 2 * M_PI));
    s.descriptor = terrain_[i].descriptor;
    seen.push_back(s);
  }
  // A detector keeps the strongest: here the first of a fixed random order of the terrain.
  if (static_cast<int>(seen.size()) > options_.max_features) seen.resize(options_.max_features);
  for (Seen& s : seen) {
    for (uint64_t& bits : s.descriptor) {
      for (int b = 0; b < 64; ++b) {
        if (Uniform() < options_.bit_noise) bits ^= uint64_t{1} << b;
      }
    }
  }
  for (int i = 0; i < options_.num_clutter; ++i) {
    Seen s;
    s.keypoint.pixel = {static_cast<float>(options_.camera.width * Uniform()),
                        static_cast<float>(options_.camera.height * Uniform())};
    s.keypoint.octave = static_cast<int8_t>(8 * Uniform());
    s.keypoint.angle = static_cast<float>(2 * M_PI * Uniform() - M_PI);
    for (uint64_t& bits : s.descriptor) bits = random_();
    seen.push_back(s);
  }
  return seen;
}

SubmapId SyntheticFlight::AddSubmap(const std::vector<Rigid3>& world_from_cam, const Similarity3& submap_from_world) {
  const SubmapId submap(static_cast<int32_t>(submap_from_world_.size()));
  submap_from_world_.push_back(submap_from_world);
  Append(utime_ += 1000, SubmapStarted{submap});

  std::map<int, MapPointId> point_of;                   // terrain -> map point
  std::map<int, size_t> last_seen;                      // terrain -> keyframe of this submap
  std::map<int, std::pair<KeyframeId, int>> seen_once;  // terrain -> its only observation so far
  std::vector<Rigid3> drifted;                          // world_from_cam as the tracker believes
  for (size_t k = 0; k < world_from_cam.size(); ++k) {
    // Dead reckoning with a drift: each step is scaled and turned a little more than the truth.
    if (k == 0) {
      drifted.push_back(world_from_cam[0]);
    } else {
      Rigid3 step = world_from_cam[k - 1].Inverse() * world_from_cam[k];
      step.translation *= std::pow(1 + options_.scale_drift, static_cast<double>(k));
      const double a = options_.angle_drift_deg * M_PI / 180;
      step.rotation = step.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ()));
      drifted.push_back(drifted.back() * step);
    }
    const KeyframeId id(next_keyframe_++);
    world_from_keyframe_.push_back(world_from_cam[k]);
    const auto step_back = [&](const Rigid3& pose, const Rigid3& next) { return pose * next.Inverse() * pose; };
    const Rigid3 after =
        k + 1 < world_from_cam.size() ? world_from_cam[k + 1] : step_back(world_from_cam[k], world_from_cam[k - 1]);
    const Rigid3 before = k > 0 ? world_from_cam[k - 1] : step_back(world_from_cam[k], after);
    const std::vector<Seen> seen = Observe(world_from_cam[k], before, after);
    const double local_scale = std::pow(1 + options_.scale_drift, static_cast<double>(k));
    // A tracker without loop closure does not know ground again that it left a while ago.
    for (const Seen& s : seen) {
      if (s.terrain < 0) continue;
      const auto last = last_seen.find(s.terrain);
      if (last != last_seen.end() && k - last->second > 3) {
        point_of.erase(s.terrain);
        seen_once.erase(s.terrain);
      }
      last_seen[s.terrain] = k;
    }

    KeyframeRecord record;
    record.submap = submap;
    record.keyframe = id;
    record.frame = next_frame_++;
    record.cam_from_submap = TransformWorld(drifted[k].Inverse(), submap_from_world);
    MapUpdate update;
    update.submap = submap;
    for (size_t i = 0; i < seen.size(); ++i) {
      const Seen& s = seen[i];
      record.features.keypoints.push_back(s.keypoint);
      record.features.descriptors.push_back(s.descriptor);
      const bool lost_word = s.terrain < 0 || Uniform() < options_.wrong_word;
      const int word = lost_word ? static_cast<int>(kNumWords * Uniform()) : WordOf(terrain_[s.terrain].descriptor);
      record.words.push_back(word);
      record.nodes.push_back(word / kWordsPerNode);
      const auto known = s.terrain < 0 ? point_of.end() : point_of.find(s.terrain);
      record.map_points.push_back(known != point_of.end() ? known->second : MapPointId());
      if (s.terrain < 0 || known != point_of.end()) continue;
      const auto once = seen_once.find(s.terrain);
      if (once == seen_once.end()) {
        seen_once[s.terrain] = {id, static_cast<int>(i)};
        continue;
      }
      // Second sight: a map point, placed where the drifted camera believes it, with the depth noise of a short
      // baseline.
      const Eigen::Vector3d x_cam = world_from_cam[k].Inverse() * terrain_[s.terrain].position;
      const double depth_noise = 1 + 0.004 * Normal();
      const Eigen::Vector3d believed = drifted[k] * Eigen::Vector3d(local_scale * depth_noise * x_cam);
      const MapPointId point(next_point_++);
      point_of[s.terrain] = point;
      update.points.push_back({point, (submap_from_world * believed).cast<float>()});
      update.observations.push_back({once->second.first, once->second.second, point});
      update.observations.push_back({id, static_cast<int>(i), point});
      seen_once.erase(once);
    }
    record.bow = MakeBow(record.words);
    utime_ += 1000000;
    update.frames.push_back({record.frame, utime_, id, Rigid3()});
    Append(utime_, std::move(record));
    Append(utime_, std::move(update));
  }
  Append(utime_, SubmapEnded{submap, "input_gap", "test", next_frame_ - 1, utime_});
  return submap;
}

void SyntheticFlight::End() { Append(utime_, SessionEnded{next_frame_}); }

Session SyntheticFlight::Model() const {
  Session session;
  for (const Record& r : records_) EXPECT_EQ(session.Apply(r), "");
  return session;
}

}  // namespace mapmend::testing

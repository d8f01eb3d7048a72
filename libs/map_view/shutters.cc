#include "libs/map_view/shutters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "libs/map_view/image_pixels.h"
#include "libs/merging/rolling_shutter.h"

namespace mapmend {
namespace {

constexpr size_t kMostKeyframes = 200;  // of a session that are asked
constexpr double kMinGain = 0.03;       // share of the squared residuals that a readout time must explain
constexpr double kMinReadout = 2e-3;    // seconds
constexpr double kOutlier = 2;          // pixels: beyond, an observation counts less (Cauchy)

// Motions of a submap's keyframes, by id.
std::map<KeyframeId, CameraMotion> MotionsOf(const Submap& submap) {
  std::map<KeyframeId, CameraMotion> motions;
  const std::vector<CameraMotion> all = KeyframeMotions(submap);
  size_t i = 0;
  for (const auto& [id, keyframe] : submap.keyframes) motions[id] = all[i++];
  return motions;
}

// Where in the image a pixel of the ideal camera was read, -0.5 to 0.5 along its rows and columns.
std::array<double, 2> PlacesInImage(const Camera& lens, const Pinhole& ideal, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d real = lens.Project(ideal.Unproject(pixel));
  return {real.y() / lens.height - 0.5, real.x() / lens.width - 0.5};
}

// Robust linear regression through zero: residual = -readout * correction, in one round from the residuals as they are.
struct Regression {
  double cross = 0, square = 0, residual = 0;

  void Add(const Eigen::Vector2d& r, const Eigen::Vector2d& c) {
    const double weight = 1 / (1 + r.squaredNorm() / (kOutlier * kOutlier));
    cross += weight * r.dot(c);
    square += weight * c.squaredNorm();
    residual += weight * r.squaredNorm();
  }
  double Readout() const { return square > 0 ? -cross / square : 0; }
  // Share of the squared residuals that it explains.
  double Gain() const { return square > 0 && residual > 0 ? cross * cross / (square * residual) : 0; }
};

// What all features of a session say: of lines that are rows, and of columns.
class SessionFit {
 public:
  void Add(const SessionStarted& info, const SnapshotKeyframe& keyframe, const SubmapKeyframe& source,
           const CameraMotion& motion, const std::map<MapPointId, Eigen::Vector3d>& points) {
    const Camera lens = LensOf(info.camera, info.pinhole);
    for (size_t i = 0; i < source.map_points.size(); ++i) {
      const auto point = source.map_points[i].IsValid() ? points.find(source.map_points[i]) : points.end();
      if (point == points.end()) continue;
      const Eigen::Vector3d x_cam = keyframe.cam_from_root * point->second / keyframe.scale;  // submap's units
      if (!(x_cam.z() > 0)) continue;
      const Eigen::Vector2d seen = source.features.keypoints[i].pixel.cast<double>();
      const Eigen::Vector2d residual = seen - info.pinhole.Project(x_cam);
      const std::array<double, 2> places = PlacesInImage(lens, info.pinhole, seen);
      for (size_t k = 0; k < fits_.size(); ++k)
        fits_[k].Add(residual, ShutterCorrection(info.pinhole, motion, x_cam, places[k]));
    }
  }
  FoundShutter Best() const {
    const bool by_columns = fits_[1].Gain() > fits_[0].Gain();
    const Regression& fit = fits_[by_columns ? 1 : 0];
    if (fit.Gain() < kMinGain || std::abs(fit.Readout()) < kMinReadout) return {};
    return {fit.Readout(), by_columns};
  }

 private:
  std::array<Regression, 2> fits_;
};

}  // namespace

std::map<std::string, FoundShutter> FindShutters(const Snapshot& snapshot) {
  std::map<std::string, SessionFit> fits;
  std::map<std::string, size_t> num_keyframes, num_seen;
  for (const SnapshotComponent& component : snapshot.components) {
    for (const SnapshotKeyframe& keyframe : component.keyframes)
      ++num_keyframes[snapshot.submaps[keyframe.submap].key.session];
  }
  std::vector<std::map<KeyframeId, CameraMotion>> motions;
  for (const SnapshotSubmap& submap : snapshot.submaps) motions.push_back(MotionsOf(*submap.submap));
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    std::map<int, std::map<MapPointId, Eigen::Vector3d>> points;  // by submap
    for (const ColoredPoint& point : ComponentPoints(snapshot, c)) points[point.submap][point.id] = point.position;
    for (const SnapshotKeyframe& keyframe : snapshot.components[c].keyframes) {
      const SnapshotSubmap& submap = snapshot.submaps[keyframe.submap];
      const std::string& session = submap.key.session;
      const size_t step = 1 + num_keyframes[session] / kMostKeyframes;
      if (num_seen[session]++ % step != 0) continue;
      fits[session].Add(snapshot.model->GetSession(session).info, keyframe, submap.submap->keyframes.at(keyframe.id),
                        motions[static_cast<size_t>(keyframe.submap)].at(keyframe.id), points[keyframe.submap]);
    }
  }
  std::map<std::string, FoundShutter> shutters;
  for (const auto& [session, fit] : fits) {
    if (const FoundShutter found = fit.Best(); found.readout != 0) shutters[session] = found;
  }
  return shutters;
}

std::vector<ReadoutMove> ReadoutMoves(const Snapshot& snapshot, int component,
                                      const std::map<std::string, FoundShutter>& shutters) {
  const std::vector<SnapshotKeyframe>& keyframes = snapshot.components[component].keyframes;
  std::vector<ReadoutMove> moves(keyframes.size());
  if (shutters.empty()) return moves;
  std::map<int, std::map<KeyframeId, CameraMotion>> motions;  // by submap
  for (size_t i = 0; i < keyframes.size(); ++i) {
    const SnapshotSubmap& submap = snapshot.submaps[keyframes[i].submap];
    const auto shutter = shutters.find(submap.key.session);
    if (shutter == shutters.end()) continue;
    const auto [known, is_new] = motions.try_emplace(keyframes[i].submap);
    if (is_new) known->second = MotionsOf(*submap.submap);
    const CameraMotion& motion = known->second.at(keyframes[i].id);
    moves[i].shift = shutter->second.readout * keyframes[i].scale * motion.velocity;
    moves[i].turn = shutter->second.readout * motion.turn_rate;
  }
  return moves;
}

}  // namespace mapmend

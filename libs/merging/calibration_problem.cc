#include "libs/merging/calibration_problem.h"

#include <algorithm>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

namespace mapmend {
namespace {

using PointKey = std::pair<std::string, MapPointId>;  // session, id

bool AreSame(const Camera& a, const Camera& b) {
  return a.model == b.model && a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion == b.distortion;
}

// The refined points of a component, and which of them a submap's point has become.
class RefinedPoints {
 public:
  RefinedPoints(const MapRevision& revision, const std::set<SubmapKey>& component) {
    for (const RefinedSubmap& submap : revision.refined) {
      if (!component.contains(submap.key)) continue;
      for (const RefinedSubmap::Point& point : submap.points)
        positions_[{submap.key.session, point.id}] = point.position.cast<double>();
      for (const RefinedSubmap::Fused& f : submap.fused) fused_[{submap.key.session, f.id}] = {f.into_session, f.into};
    }
  }

  std::optional<PointKey> Find(PointKey key) const {
    for (size_t step = 0; step <= fused_.size(); ++step) {
      const auto it = fused_.find(key);
      if (it == fused_.end()) return positions_.contains(key) ? std::optional(key) : std::nullopt;
      key = it->second;
    }
    return std::nullopt;  // a cycle
  }
  const Eigen::Vector3d& Position(const PointKey& key) const { return positions_.at(key); }

 private:
  std::map<PointKey, Eigen::Vector3d> positions_;
  std::map<PointKey, PointKey> fused_;
};

std::set<SubmapKey> MainComponent(const MapRevision& revision) {
  std::set<SubmapKey> keys;
  for (const MergedTransforms::Place& place : revision.transforms.submaps) {
    if (place.component == 0) keys.insert(place.key);
  }
  return keys;
}

struct PointTrack {
  PointKey key;
  std::vector<CalibrationObservation> observations;  // one for each pose
};

// Longest tracks first, until every pose has enough.
void TakePoints(std::vector<PointTrack> tracks, const RefinedPoints& points, int per_pose,
                CalibrationProblem* problem) {
  std::stable_sort(tracks.begin(), tracks.end(), [](const PointTrack& l, const PointTrack& r) {
    return l.observations.size() > r.observations.size();
  });
  std::vector<int> count(problem->poses.size(), 0);
  for (const PointTrack& track : tracks) {
    if (track.observations.size() < 2) break;
    const bool is_wanted =
        per_pose <= 0 || std::any_of(track.observations.begin(), track.observations.end(),
                                     [&](const CalibrationObservation& o) { return count[o.pose] < per_pose; });
    if (!is_wanted) continue;
    for (CalibrationObservation o : track.observations) {
      ++count[o.pose];
      o.point = static_cast<int>(problem->points.size());
      problem->observations.push_back(o);
    }
    problem->points.push_back(points.Position(track.key));
  }
}

}  // namespace

CalibrationProblem MakeCalibrationProblem(const std::map<std::string, Session>& sessions, const MapRevision& revision,
                                          const CalibrationProblemOptions& options) {
  CalibrationProblem problem;
  const std::set<SubmapKey> component = MainComponent(revision);
  const RefinedPoints points(revision, component);
  std::map<PointKey, PointTrack> tracks;
  bool has_camera = false;
  for (const RefinedSubmap& refined : revision.refined) {
    if (!component.contains(refined.key)) continue;
    const Session& session = sessions.at(refined.key.session);
    const Camera& camera = session.info.camera;
    if (!has_camera) problem.camera = camera;
    if (std::exchange(has_camera, true) && !AreSame(camera, problem.camera))
      throw std::runtime_error("the main map holds flights of different cameras, or with different calibrations");
    const Submap& submap = session.submaps.at(refined.key.submap);
    for (const RefinedSubmap::Keyframe& placed : refined.keyframes) {
      const auto found = submap.keyframes.find(placed.id);
      if (found == submap.keyframes.end()) continue;
      const SubmapKeyframe& keyframe = found->second;
      const int pose = static_cast<int>(problem.poses.size());
      problem.poses.push_back(placed.cam_from_root);
      std::set<PointKey> seen;
      for (int i = 0; i < keyframe.features.Size(); ++i) {
        const MapPointId id = keyframe.map_points[i];
        const auto key = id.IsValid() ? points.Find({refined.key.session, id}) : std::nullopt;
        if (!key || !seen.insert(*key).second) continue;
        const Keypoint& keypoint = keyframe.features.keypoints[i];
        CalibrationObservation o;
        o.pose = pose;
        o.pixel = camera.Project(session.info.pinhole.Unproject(keypoint.pixel.cast<double>()));
        o.sigma = session.info.pyramid.Sigma(keypoint.octave);
        tracks[*key].key = *key;
        tracks[*key].observations.push_back(o);
      }
    }
  }
  if (problem.poses.empty()) throw std::runtime_error("the map is not refined: `mapmend merge` refines it");
  std::vector<PointTrack> list;
  list.reserve(tracks.size());
  for (auto& [key, track] : tracks) list.push_back(std::move(track));
  TakePoints(std::move(list), points, options.points_per_keyframe, &problem);
  return problem;
}

}  // namespace mapmend

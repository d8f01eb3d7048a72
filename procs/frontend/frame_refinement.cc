#include "procs/frontend/frame_refinement.h"

namespace mapmend {

std::vector<Sighting> SightingsOf(const Frame& frame, const std::vector<PointIndex>& points, const Pyramid& pyramid) {
  std::vector<Sighting> sightings;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].IsNone()) continue;
    const Keypoint& keypoint = frame.features.keypoints[i];
    sightings.push_back({points[i], keypoint.pixel, static_cast<float>(pyramid.Sigma(keypoint.octave))});
  }
  return sightings;
}

namespace {

std::vector<PoseObservation> ObservationsOf(const std::vector<Sighting>& sightings, const WorkingMap& map) {
  std::vector<PoseObservation> observations;
  for (const Sighting& s : sightings) {
    const WorkingPoint& point = map.Point(s.point);
    if (!point.removed) observations.push_back({point.position, s.pixel.cast<double>(), s.sigma});
  }
  return observations;
}

}  // namespace

std::optional<Rigid3> FrameRefinement::Refine(const Rigid3& cam_from_submap, const std::vector<Sighting>& sightings,
                                              const WorkingMap& map) const {
  if (!options_.use) return std::nullopt;
  return Optimize(cam_from_submap, ObservationsOf(sightings, map));
}

std::optional<Rigid3> FrameRefinement::FindAnew(const std::vector<Sighting>& sightings, const WorkingMap& map) const {
  const std::vector<PoseObservation> observations = ObservationsOf(sightings, map);
  if (static_cast<int>(observations.size()) < options_.min_points) return std::nullopt;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> sigmas;
  for (const PoseObservation& o : observations) {
    points.push_back(o.point);
    pixels.push_back(o.pixel);
    sigmas.push_back(o.sigma);
  }
  const PnpResult pnp = SolvePnpRansac(camera_, points, pixels, sigmas, options_.pnp);
  return pnp.success ? Optimize(pnp.cam_from_world, observations) : std::nullopt;
}

std::optional<Rigid3> FrameRefinement::Optimize(const Rigid3& cam_from_submap,
                                                const std::vector<PoseObservation>& observations) const {
  const auto num_points = static_cast<int>(observations.size());
  if (num_points < options_.min_points) return std::nullopt;
  const PoseOptimizationResult pose = OptimizePose(camera_, cam_from_submap, observations, options_.pose);
  if (!pose.success || pose.num_inliers < options_.min_kept_share * num_points) return std::nullopt;
  return pose.cam_from_world;
}

}  // namespace mapmend

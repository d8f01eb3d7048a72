#include "procs/frontend/local_bundle.h"

#include <algorithm>
#include <utility>

#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr size_t kMinObservations = 2;  // of a point: fewer say nothing about the poses

}  // namespace

void LocalBundle::AdjustAround(KeyframeIndex keyframe, WorkingMap* map, MapLock* lock) {
  const StageTimer timer("map/bundle");
  std::vector<KeyframeIndex> free = MostCovisible(keyframe, *map);
  std::vector<KeyframeIndex> fixed = FixedFor(free, *map);
  // In a young submap its oldest keyframe holds the frame. What the first two are to each other is as uncertain as the
  // rest; the scale, which nothing changes, needs no hold.
  std::sort(free.begin(), free.end());
  if (fixed.empty() && free.size() > 1) {
    fixed.push_back(free.front());
    free.erase(free.begin());
  }
  Adjust(free, fixed, options_.bundle_iterations, map, lock);
}

void LocalBundle::AdjustAll(WorkingMap* map) {
  std::vector<KeyframeIndex> free, fixed;
  for (KeyframeIndex k(0); k <= map->LastKeyframe(); ++k) {
    if (!map->Keyframe(k).removed) (fixed.empty() ? fixed : free).push_back(k);
  }
  Adjust(free, fixed, options_.final_iterations, map, nullptr);
}

std::vector<KeyframeIndex> LocalBundle::MostCovisible(KeyframeIndex keyframe, const WorkingMap& map) const {
  std::vector<KeyframeIndex> keyframes = {keyframe};
  for (const Covisible& c : map.CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (static_cast<int>(keyframes.size()) >= options_.bundle_keyframes) break;
    keyframes.push_back(c.keyframe);
  }
  return keyframes;
}

std::vector<KeyframeIndex> LocalBundle::FixedFor(const std::vector<KeyframeIndex>& free, const WorkingMap& map) const {
  std::vector<int> shared(map.Keyframes().size(), 0);  // points with the free keyframes
  for (const PointIndex p : map.PointsOf(free)) {
    for (const WorkingObservation& o : map.Point(p).observations) ++shared[o.keyframe];
  }
  for (const KeyframeIndex k : free) shared[k] = 0;
  std::vector<std::pair<int, KeyframeIndex>> by_weight;  // (-shared, keyframe)
  for (KeyframeIndex k(0); k <= map.LastKeyframe(); ++k) {
    if (shared[k] > 0) by_weight.emplace_back(-shared[k], k);
  }
  std::sort(by_weight.begin(), by_weight.end());
  std::vector<KeyframeIndex> fixed;
  for (size_t i = 0; i < by_weight.size() && i < static_cast<size_t>(options_.bundle_fixed_keyframes); ++i) {
    fixed.push_back(by_weight[i].second);
  }
  return fixed;
}

LocalBundle::Window LocalBundle::Collect(const std::vector<KeyframeIndex>& free,
                                         const std::vector<KeyframeIndex>& fixed, const WorkingMap& map) const {
  Window window;
  BundleProblem& problem = window.problem;
  problem.cameras = {camera_};
  std::vector<int> pose_of(map.Keyframes().size(), -1);
  const auto add_pose = [&](KeyframeIndex k, bool is_fixed) {
    pose_of[k] = static_cast<int>(problem.poses.size());
    window.keyframes.push_back(k);
    problem.poses.push_back({map.Keyframe(k).cam_from_submap, is_fixed, 0});
  };
  for (const KeyframeIndex k : free) add_pose(k, false);
  for (const KeyframeIndex k : fixed) add_pose(k, true);
  for (const PointIndex p : map.PointsOf(free)) {
    const WorkingPoint& point = map.Point(p);
    const int slot = static_cast<int>(problem.points.size());
    const size_t begin = problem.observations.size();
    for (const WorkingObservation& o : point.observations) {
      const int pose = pose_of[o.keyframe];
      if (pose < 0) continue;
      const Keypoint& keypoint = map.Keyframe(o.keyframe).frame->features.keypoints[o.feature];
      problem.observations.push_back({pose, slot, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
      window.sources.push_back({p, o.keyframe});
    }
    if (problem.observations.size() - begin < kMinObservations) {
      problem.observations.resize(begin);
      window.sources.resize(begin);
      continue;
    }
    problem.points.push_back(point.position);
    window.points.push_back(p);
  }
  return window;
}

void LocalBundle::Adjust(const std::vector<KeyframeIndex>& free, const std::vector<KeyframeIndex>& fixed,
                         int iterations, WorkingMap* map, MapLock* lock) {
  Window window = Collect(free, fixed, *map);
  BundleOptions options;
  options.max_iterations = iterations;
  options.points_per_pose = options_.bundle_points;
  if (lock != nullptr) lock->unlock();
  const bool success = bundle_.Adjust(options, &window.problem).success;
  if (lock != nullptr) lock->lock();
  if (success) Apply(window, map);
}

void LocalBundle::Apply(const Window& window, WorkingMap* map) const {
  const BundleProblem& problem = window.problem;
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    if (!problem.poses[i].fixed) map->SetPose(window.keyframes[i], problem.poses[i].cam_from_world);
  }
  for (size_t i = 0; i < window.points.size(); ++i) map->SetPosition(window.points[i], problem.points[i]);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const Source& source = window.sources[i];
    const double chi2 =
        ReprojectionChi2(camera_, problem.poses[o.pose].cam_from_world, problem.points[o.point], o.pixel, o.sigma);
    if (chi2 > options_.outlier_chi2 && !map->Point(source.point).removed)
      map->RemoveObservation(source.point, source.keyframe);
  }
  for (const PointIndex p : window.points) map->RefreshPoint(p);
}

}  // namespace mapmend

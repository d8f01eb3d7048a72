#include "procs/frontend/local_mapper.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include "libs/geometry/chi_square.h"
#include "libs/geometry/triangulation.h"
#include "libs/optim/bundle_adjustment.h"
#include "libs/optim/pose_optimization.h"
#include "procs/frontend/profiler.h"

namespace mapmend {
namespace {

constexpr double kMinDepth = 1e-3;       // nearer than that a projection says nothing; the submap's first depth is 1
constexpr int kBeyondAnyDistance = 257;  // bits; descriptors have 256

bool InImage(const Pinhole& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera.width && pixel.y() < camera.height;
}

// Whether pixels lie near the segment from p0 to p1, with as much slack at its ends.
class SegmentTest {
 public:
  SegmentTest(const Eigen::Vector2d& p0, const Eigen::Vector2d& p1) : p0_(p0), length_((p1 - p0).norm()) {
    if (length_ >= 1e-6) direction_ = (p1 - p0) / length_;
  }
  bool IsNear(const Eigen::Vector2d& pixel, double limit) const {
    const Eigen::Vector2d d = pixel - p0_;
    if (length_ < 1e-6) return d.norm() < limit;
    const double along = d.dot(direction_), across = std::abs(d.x() * direction_.y() - d.y() * direction_.x());
    return across < limit && along > -limit && along < length_ + limit;
  }

 private:
  Eigen::Vector2d p0_, direction_ = Eigen::Vector2d::Zero();
  double length_;
};

}  // namespace

void LocalMapper::Process(int keyframe, WorkingMap* map, MapLock* lock) {
  CullRecentPoints(keyframe, map);
  for (const int p : map->PointsOf(keyframe)) map->RefreshPoint(p);
  std::vector<int> neighbours;
  for (const Covisible& c : map->CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (static_cast<int>(neighbours.size()) >= options_.num_neighbours) break;
    neighbours.push_back(c.keyframe);
  }
  GiveWay(lock);
  FuseWithOverlapping(keyframe, neighbours, map);
  Triangulate(keyframe, neighbours, map, lock);
  FuseNeighbourhood(keyframe, neighbours, map, lock);
  AdjustLocal(keyframe, map, lock);
  CullKeyframes(keyframe, map);
}

void LocalMapper::FuseNeighbourhood(int keyframe, const std::vector<int>& neighbours, WorkingMap* map,
                                    MapLock* lock) const {
  const StageTimer timer("map/fuse");
  // Fuse with the neighbours and with theirs.
  std::vector<int> targets = neighbours;
  std::set<int> seen(neighbours.begin(), neighbours.end());
  seen.insert(keyframe);
  for (size_t i = 0; i < std::min<size_t>(options_.num_expanded, neighbours.size()); ++i) {
    int added = 0;
    for (const Covisible& c : map->CovisibleKeyframes(neighbours[i], options_.expanded_min_covisible)) {
      if (added >= options_.expanded_neighbours) break;
      if (seen.insert(c.keyframe).second) targets.push_back(c.keyframe), ++added;
    }
  }
  const std::vector<int> own = map->PointsOf(keyframe);
  for (const int k : targets) {
    FuseInto(k, own, options_.fuse_radius_px, map);
    GiveWay(lock);
  }
  FuseInto(keyframe, map->PointsOf(targets), options_.fuse_radius_px, map);
  for (const int p : map->PointsOf(keyframe)) map->RefreshPoint(p);
}

void LocalMapper::CullRecentPoints(int keyframe, WorkingMap* map) const {
  const StageTimer timer("map/cull");
  for (size_t i = 0; i < map->Points().size(); ++i) {
    const WorkingPoint& point = map->Points()[i];
    if (point.removed) continue;
    const int age = keyframe - point.first_keyframe;
    if (age > options_.probation_keyframes || age < 1) continue;
    const bool rarely_found = point.found < options_.min_found_share * point.visible;
    const bool not_confirmed =
        age >= options_.probation_keyframes && static_cast<int>(point.observations.size()) < options_.min_observations;
    if (rarely_found || not_confirmed) map->RemovePoint(static_cast<int>(i));
  }
}

void LocalMapper::CullKeyframes(int keyframe, WorkingMap* map) const {
  const StageTimer timer("map/cull");
  constexpr int kFirst = 2;   // the pair that gave the submap its frame and scale stays
  constexpr int kNewest = 3;  // tracking matches with them
  for (const Covisible& c : map->CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (c.keyframe < kFirst || c.keyframe > keyframe - kNewest || !map->Keyframe(c.keyframe).published) continue;
    if (IsRedundant(c.keyframe, *map)) map->RemoveKeyframe(c.keyframe);
  }
}

bool LocalMapper::IsRedundant(int keyframe, const WorkingMap& map) const {
  const Frame& frame = *map.Keyframe(keyframe).frame;
  int num_points = 0, num_redundant = 0;
  for (int i = 0; i < frame.features.Size(); ++i) {
    if (frame.points[i] < 0) continue;
    ++num_points;
    const int coarsest = frame.features.keypoints[i].octave + 1;
    int observers = -1;  // not counting itself
    for (const WorkingObservation& o : map.Point(frame.points[i]).observations) {
      if (map.Keyframe(o.keyframe).frame->features.keypoints[o.feature].octave <= coarsest) ++observers;
      if (observers == options_.redundant_observers) break;
    }
    num_redundant += observers == options_.redundant_observers;
  }
  return num_redundant > options_.redundant_share * num_points;
}

void LocalMapper::Triangulate(int keyframe, const std::vector<int>& neighbours, WorkingMap* map, MapLock* lock) const {
  const StageTimer timer("map/triangulate");
  const Frame& frame = *map->Keyframe(keyframe).frame;
  std::vector<double> depths;
  for (const int p : frame.points) {
    if (p >= 0) depths.push_back((frame.cam_from_submap * map->Point(p).position).z());
  }
  if (static_cast<int>(depths.size()) < options_.min_depths) return;
  std::sort(depths.begin(), depths.end());
  const double near = options_.nearest_depth * depths[depths.size() / 20],
               far = options_.farthest_depth * depths[depths.size() * 19 / 20];
  for (const int neighbour : neighbours) {
    const double baseline =
        (map->Keyframe(neighbour).frame->cam_from_submap.Center() - frame.cam_from_submap.Center()).norm();
    if (baseline < options_.min_baseline * depths[depths.size() / 2]) continue;
    TriangulateWith(keyframe, neighbour, near, far, map);
    GiveWay(lock);
  }
}

int LocalMapper::TriangulateWith(int keyframe, int neighbour, double near, double far, WorkingMap* map) const {
  const Frame& a = *map->Keyframe(keyframe).frame;
  const Frame& b = *map->Keyframe(neighbour).frame;
  const Rigid3 b_from_a = b.cam_from_submap * a.cam_from_submap.Inverse();
  const Eigen::Matrix3d R = b_from_a.rotation.toRotationMatrix();
  const double max_cosine = std::cos(options_.min_angle_deg * M_PI / 180);
  std::vector<double> limits;  // from the epipolar line, pixels, per octave
  limits.reserve(pyramid_.num_levels);
  for (int octave = 0; octave < pyramid_.num_levels; ++octave) limits.push_back(kChi1Dof95 * pyramid_.Sigma(octave));
  struct Candidate {
    int distance = -1, feature = -1;
    Eigen::Vector3d position;
  };
  std::vector<Candidate> claimed(b.features.Size());  // by feature of b
  for (int i = 0; i < a.features.Size(); ++i) {
    if (a.points[i] >= 0) continue;
    const Keypoint& keypoint = a.features.keypoints[i];
    const Eigen::Vector3d ray = camera_.Unproject(keypoint.pixel.cast<double>());
    const Eigen::Vector3d rotated = R * ray;
    const Eigen::Vector3d x0 = near * rotated + b_from_a.translation, x1 = far * rotated + b_from_a.translation;
    if (x0.z() <= kMinDepth || x1.z() <= kMinDepth) continue;
    const Eigen::Vector2d p0 = camera_.Project(x0), p1 = camera_.Project(x1);
    if (!p0.allFinite() || !p1.allFinite() ||
        (p1 - p0).cwiseAbs().maxCoeff() > options_.max_search_length * camera_.width)
      continue;
    int best = -1, best_distance = options_.max_distance + 1, second = kBeyondAnyDistance;
    const SegmentTest epipolar(p0, p1);
    b.grid.VisitAlong(p0.cast<float>(), p1.cast<float>(), static_cast<float>(limits.back()), [&](int j) {
      if (b.points[j] >= 0) return;
      const int distance = HammingDistance(a.features.descriptors[i], b.features.descriptors[j]);
      if (distance >= second) return;  // the cheaper test first
      const Keypoint& other = b.features.keypoints[j];
      if (!epipolar.IsNear(other.pixel.cast<double>(), limits[other.octave])) return;
      if (distance < best_distance) {
        second = best_distance;
        best_distance = distance;
        best = j;
      } else {
        second = distance;
      }
    });
    if (best < 0 || best_distance >= options_.ratio * second) continue;
    const Keypoint& other = b.features.keypoints[best];
    const auto x = mapmend::Triangulate(ray, camera_.Unproject(other.pixel.cast<double>()), b_from_a);
    if (!x || x->z() < near || x->z() > far) continue;
    if (CosIntersectionAngle(*x, Eigen::Vector3d::Zero(), b_from_a.Center()) > max_cosine) continue;
    const double chi2_a =
        ReprojectionChi2(camera_, {}, *x, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave));
    const double chi2_b =
        ReprojectionChi2(camera_, b_from_a, *x, other.pixel.cast<double>(), pyramid_.Sigma(other.octave));
    if (chi2_a > options_.outlier_chi2 || chi2_b > options_.outlier_chi2) continue;
    // The patch sizes must agree with the distances.
    const double by_distance = (b_from_a * *x).norm() / x->norm();
    const double by_octave = pyramid_.Scale(keypoint.octave) / pyramid_.Scale(other.octave);
    if (by_distance > by_octave * options_.scale_slack || by_distance * options_.scale_slack < by_octave) continue;
    Candidate& claim = claimed[best];
    if (claim.feature < 0 || best_distance < claim.distance) claim = {best_distance, i, *x};
  }
  const Rigid3 submap_from_a = a.cam_from_submap.Inverse();
  int count = 0;
  for (int j = 0; j < b.features.Size(); ++j) {
    const Candidate& candidate = claimed[j];
    if (candidate.feature < 0) continue;
    const int point = map->AddPoint(submap_from_a * candidate.position, keyframe);
    map->AddObservation(point, neighbour, j);
    map->AddObservation(point, keyframe, candidate.feature);
    map->RefreshPoint(point);
    ++count;
  }
  return count;
}

int LocalMapper::FuseInto(int keyframe, const std::vector<int>& points, double radius_px, WorkingMap* map) const {
  const Frame& frame = *map->Keyframe(keyframe).frame;
  const Eigen::Vector3d center = frame.cam_from_submap.Center();
  std::vector<uint8_t> is_own(map->Points().size(), 0);
  for (const int p : frame.points) {
    if (p >= 0) is_own[p] = 1;
  }
  static const std::vector<uint8_t> kNoneUsed;
  int count = 0;
  for (const int index : points) {
    const WorkingPoint& point = map->Point(index);
    if (point.removed || is_own[index]) continue;
    const Eigen::Vector3d x = frame.cam_from_submap * point.position;
    if (x.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera_.Project(x);
    if (!InImage(camera_, pixel)) continue;
    const Eigen::Vector3d to_camera = center - point.position;
    const double distance = to_camera.norm();
    if (to_camera.dot(point.normal) < options_.min_view_cos * distance) continue;
    const int octave = map->PredictOctave(point, distance);
    GuidedSearch search;
    search.radius = static_cast<float>(radius_px * pyramid_.Scale(octave));
    search.min_octave = octave - options_.octave_tolerance;
    search.max_octave = octave + options_.octave_tolerance;
    search.max_distance = options_.max_distance;
    search.ratio = 1.0;  // no second best: the window is small, and two points at one place are what is looked for
    const Match match = FindNear(frame.features, frame.grid, pixel.cast<float>(), point.descriptor, search, kNoneUsed);
    if (match.b < 0) continue;
    const Keypoint& keypoint = frame.features.keypoints[match.b];
    if (ReprojectionChi2(camera_, frame.cam_from_submap, point.position, keypoint.pixel.cast<double>(),
                         pyramid_.Sigma(keypoint.octave)) > options_.fuse_chi2_factor * options_.outlier_chi2) {
      continue;
    }
    const int existing = frame.points[match.b];
    if (existing < 0) {
      map->AddObservation(index, keyframe, match.b);
    } else if (map->Point(existing).observations.size() > point.observations.size()) {
      map->FusePoints(index, existing);
    } else {
      map->FusePoints(existing, index);
    }
    ++count;
  }
  return count;
}

// Survey flights come back beside their own strips: keyframes far away in time see the same ground, with a little
// drift. Their points are projected with a wider window; if enough of them agree on a small correction, they are the
// same points.
void LocalMapper::FuseWithOverlapping(int keyframe, const std::vector<int>& neighbours, WorkingMap* map) const {
  const StageTimer timer("map/overlap");
  const Frame& frame = *map->Keyframe(keyframe).frame;
  std::vector<double> depths;
  for (const int p : frame.points) {
    if (p >= 0) depths.push_back((frame.cam_from_submap * map->Point(p).position).z());
  }
  if (depths.empty()) return;
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  const double depth = depths[depths.size() / 2];
  const Eigen::Vector3d center = frame.cam_from_submap.Center();
  const Eigen::Vector3d axis = frame.cam_from_submap.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d looked_at = center + depth * axis;
  std::set<int> known(neighbours.begin(), neighbours.end());
  struct Overlapping {
    double offset;
    int keyframe;
  };
  std::vector<Overlapping> candidates;
  for (int k = 0; k < keyframe; ++k) {
    if (map->Keyframe(k).removed || known.contains(k)) continue;
    const Rigid3& other = map->Keyframe(k).frame->cam_from_submap;
    const Eigen::Vector3d x = other * looked_at;
    const Eigen::Vector3d other_axis = other.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    if (x.z() < options_.overlap_min_depth * depth || x.z() > options_.overlap_max_depth * depth ||
        other_axis.dot(axis) < options_.overlap_min_axis_cos)
      continue;
    const double offset = (camera_.Project(x) - Eigen::Vector2d(camera_.cx, camera_.cy)).norm();
    if (offset < options_.overlap_max_offset * camera_.width) candidates.push_back({offset, k});
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Overlapping& a, const Overlapping& b) { return a.offset < b.offset; });
  if (static_cast<int>(candidates.size()) > options_.max_overlapping_keyframes) {
    candidates.resize(options_.max_overlapping_keyframes);
  }
  std::vector<int> overlapping;
  overlapping.reserve(candidates.size());
  for (const Overlapping& c : candidates) overlapping.push_back(c.keyframe);
  const std::vector<int> theirs = map->PointsOf(overlapping), own = map->PointsOf(keyframe);
  std::vector<int> points;
  std::set_difference(theirs.begin(), theirs.end(), own.begin(), own.end(), std::back_inserter(points));
  if (static_cast<int>(points.size()) < options_.overlap_min_points) return;
  struct Pair {
    int point, feature;
  };
  std::vector<Pair> pairs;
  std::vector<PoseObservation> observations;
  static const std::vector<uint8_t> kNoneUsed;
  for (const int index : points) {
    const WorkingPoint& point = map->Point(index);
    const Eigen::Vector3d x = frame.cam_from_submap * point.position;
    if (x.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera_.Project(x);
    if (!InImage(camera_, pixel)) continue;
    const int octave = map->PredictOctave(point, (center - point.position).norm());
    GuidedSearch search;
    search.radius = static_cast<float>(options_.overlap_radius * camera_.width);
    search.min_octave = octave - options_.octave_tolerance;
    search.max_octave = octave + options_.octave_tolerance;
    search.max_distance = options_.max_distance;
    search.ratio = options_.overlap_ratio;
    const Match match = FindNear(frame.features, frame.grid, pixel.cast<float>(), point.descriptor, search, kNoneUsed);
    if (match.b < 0) continue;
    const Keypoint& keypoint = frame.features.keypoints[match.b];
    pairs.push_back({index, match.b});
    observations.push_back({point.position, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }
  if (static_cast<int>(observations.size()) < options_.overlap_min_agreeing) return;
  const PoseOptimizationResult agreed = OptimizePose(camera_, frame.cam_from_submap, observations, options_.pose);
  if (!agreed.success || agreed.num_inliers < options_.overlap_min_agreeing ||
      agreed.num_inliers < options_.overlap_agreeing_share * static_cast<double>(pairs.size())) {
    return;
  }
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (!agreed.inlier[i] || map->Point(pairs[i].point).removed) continue;
    const int existing = frame.points[pairs[i].feature];
    if (existing < 0) {
      map->AddObservation(pairs[i].point, keyframe, pairs[i].feature);
    } else if (existing != pairs[i].point) {
      // The older point stays: it is held by the strip that is finished.
      map->FusePoints(existing, pairs[i].point);
    }
  }
}

void LocalMapper::AdjustLocal(int keyframe, WorkingMap* map, MapLock* lock) {
  const StageTimer timer("map/bundle");
  std::vector<int> free = {keyframe};
  for (const Covisible& c : map->CovisibleKeyframes(keyframe, options_.min_covisible)) {
    if (static_cast<int>(free.size()) >= options_.bundle_keyframes) break;
    free.push_back(c.keyframe);
  }
  std::vector<int> shared(map->Keyframes().size(), 0);  // points with the free keyframes
  for (const int p : map->PointsOf(free)) {
    for (const WorkingObservation& o : map->Point(p).observations) ++shared[o.keyframe];
  }
  for (const int k : free) shared[k] = 0;
  std::vector<std::pair<int, int>> by_weight;  // (-shared, keyframe)
  for (size_t k = 0; k < shared.size(); ++k) {
    if (shared[k] > 0) by_weight.emplace_back(-shared[k], static_cast<int>(k));
  }
  std::sort(by_weight.begin(), by_weight.end());
  std::vector<int> fixed;
  for (size_t i = 0; i < by_weight.size() && i < static_cast<size_t>(options_.bundle_fixed_keyframes); ++i) {
    fixed.push_back(by_weight[i].second);
  }
  // With fewer than two fixed keyframes the oldest free ones hold frame and scale.
  std::sort(free.begin(), free.end());
  while (fixed.size() < 2 && free.size() > 1) {
    fixed.push_back(free.front());
    free.erase(free.begin());
  }
  Adjust(free, fixed, options_.bundle_iterations, map, lock);
}

void LocalMapper::AdjustAll(WorkingMap* map) {
  std::vector<int> free, fixed;
  for (int k = 0; k <= map->LastKeyframe(); ++k) {
    (fixed.empty() ? fixed : free).push_back(k);
  }
  Adjust(free, fixed, options_.final_iterations, map, nullptr);
}

void LocalMapper::Adjust(const std::vector<int>& free_keyframes, const std::vector<int>& fixed_keyframes,
                         int iterations, WorkingMap* map, MapLock* lock) {
  BundleProblem problem;
  problem.cameras = {camera_};
  std::vector<int> pose_of(map->Keyframes().size(), -1), keyframe_of;
  const auto add_pose = [&](int k, bool fixed) {
    pose_of[k] = static_cast<int>(problem.poses.size());
    keyframe_of.push_back(k);
    problem.poses.push_back({map->Keyframe(k).frame->cam_from_submap, fixed, 0});
  };
  for (const int k : free_keyframes) add_pose(k, false);
  for (const int k : fixed_keyframes) add_pose(k, true);
  struct Source {
    int point, keyframe;
  };
  std::vector<Source> sources;
  std::vector<int> point_of;
  for (const int p : map->PointsOf(free_keyframes)) {
    const WorkingPoint& point = map->Point(p);
    const int slot = static_cast<int>(problem.points.size());
    const size_t begin = problem.observations.size();
    for (const WorkingObservation& o : point.observations) {
      const int pose = pose_of[o.keyframe];
      if (pose < 0) continue;
      const Keypoint& keypoint = map->Keyframe(o.keyframe).frame->features.keypoints[o.feature];
      problem.observations.push_back({pose, slot, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
      sources.push_back({p, o.keyframe});
    }
    if (problem.observations.size() - begin < 2) {  // says nothing about the poses
      problem.observations.resize(begin);
      sources.resize(begin);
      continue;
    }
    problem.points.push_back(point.position);
    point_of.push_back(p);
  }
  BundleOptions bundle_options;
  bundle_options.max_iterations = iterations;
  bundle_options.points_per_pose = options_.bundle_points;
  if (lock != nullptr) lock->unlock();
  const bool success = bundle_.Adjust(bundle_options, &problem).success;
  if (lock != nullptr) lock->lock();
  if (!success) return;
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    if (!problem.poses[i].fixed) map->SetPose(keyframe_of[i], problem.poses[i].cam_from_world);
  }
  for (size_t i = 0; i < point_of.size(); ++i) map->SetPosition(point_of[i], problem.points[i]);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const double chi2 =
        ReprojectionChi2(camera_, problem.poses[o.pose].cam_from_world, problem.points[o.point], o.pixel, o.sigma);
    if (chi2 > options_.outlier_chi2 && !map->Point(sources[i].point).removed) {
      map->RemoveObservation(sources[i].point, sources[i].keyframe);
    }
  }
  for (const int p : point_of) map->RefreshPoint(p);
}

}  // namespace mapmend

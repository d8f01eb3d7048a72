#include "libs/merging/overlap_matching.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "libs/connecting/guided_projection.h"
#include "libs/geometry/sim3_closed_form.h"
#include "libs/optim/pose_optimization.h"

namespace mapmend {
namespace {

bool InImage(const Pinhole& camera, const Eigen::Vector3d& x_cam) {
  if (!(x_cam.z() > 0)) return false;
  const Eigen::Vector2d u = camera.Project(x_cam);
  return u.x() >= 0 && u.y() >= 0 && u.x() < camera.width && u.y() < camera.height;
}

// Evenly chosen points that a keyframe sees.
std::vector<Eigen::Vector3d> SamplePoints(const MergedMap& map, int keyframe, int count) {
  std::vector<int> seen;
  for (const int p : map.point_of_feature[keyframe]) {
    if (p >= 0) seen.push_back(p);
  }
  std::vector<Eigen::Vector3d> samples;
  const size_t n = std::min(seen.size(), static_cast<size_t>(count));
  for (size_t i = 0; i < n; ++i) samples.push_back(map.points[seen[i * seen.size() / n]].position);
  return samples;
}

std::vector<PointAppearance> DescribeKeyframe(const MergedMap& map, int keyframe, const SearchedKeyframe& searched) {
  const MergedKeyframe& k = map.keyframes[keyframe];
  std::vector<PointAppearance> appearances;
  for (int i = 0; i < searched.features->Size(); ++i) {
    const int p = map.point_of_feature[keyframe][i];
    if (p < 0) continue;
    const Keypoint& keypoint = searched.features->keypoints[i];
    const double depth = (k.cam_from_root * map.points[p].position).z();
    if (!(depth > 0)) continue;
    appearances.push_back({MapPointId(p), map.points[p].position, searched.features->descriptors[i], keypoint.octave,
                           keypoint.angle,
                           map.PyramidOf(keyframe).Scale(keypoint.octave) * depth / map.CameraOf(keyframe).fx, 0});
  }
  return appearances;
}

void MatchOneWay(const MergedMap& map, int source, const SearchedKeyframe& searched_source, int target,
                 const SearchedKeyframe& searched_target, const OverlapMatchingOptions& options,
                 std::vector<OverlapMatch>* out) {
  const MergedKeyframe &s = map.keyframes[source], &t = map.keyframes[target];
  std::vector<PointAppearance> appearances = DescribeKeyframe(map, source, searched_source);
  std::erase_if(appearances, [&](const PointAppearance& a) {
    const Track& track = map.points[a.id.value].track;
    return std::any_of(track.begin(), track.end(), [&](const TrackElement& e) { return e.keyframe == target; });
  });
  ProjectionSearchOptions search;
  search.radius = options.radius;
  search.max_distance = options.max_distance;
  search.ratio = options.ratio;
  search.octave_tolerance = options.octave_tolerance;
  const std::vector<Keypoint>& keypoints = searched_target.features->keypoints;
  const ProjectionMatches found = FindByProjection(
      appearances, {s.cam_from_root.rotation}, Similarity3(t.cam_from_root), map.CameraOf(target),
      map.PyramidOf(target), keypoints, searched_target.features->descriptors, searched_target.grid, search);
  if (static_cast<int>(found.matches.size()) < options.min_matches) return;
  std::vector<PoseObservation> observations;
  for (const ProjectionMatch& m : found.matches) {
    const Keypoint& keypoint = keypoints[m.feature];
    observations.push_back({appearances[m.appearance].position, keypoint.pixel.cast<double>(),
                            map.PyramidOf(target).Sigma(keypoint.octave)});
  }
  PoseOptimizationOptions pose_options;
  pose_options.outlier_chi2 = options.outlier_chi2;
  const PoseOptimizationResult pose = OptimizePose(map.CameraOf(target), t.cam_from_root, observations, pose_options);
  if (!pose.success || pose.num_inliers < options.min_matches ||
      pose.num_inliers < options.min_inlier_rate * static_cast<double>(observations.size())) {
    return;
  }
  for (size_t i = 0; i < found.matches.size(); ++i) {
    if (!pose.inlier[i]) continue;
    OverlapMatch& match = out->emplace_back();
    match.point = appearances[found.matches[i].appearance].id.value;
    match.element.keyframe = target;
    match.element.feature = found.matches[i].feature;
    match.element.SetPlace(keypoints[found.matches[i].feature]);
  }
}

}  // namespace

std::vector<OverlappingPair> FindOverlappingPairs(const MergedMap& map, const OverlapOptions& options) {
  const int n = static_cast<int>(map.keyframes.size());
  std::vector<int> num_points(n, 0);
  std::vector<std::map<int, int>> shared(n);  // [a][b], a < b
  for (const MergedPoint& p : map.points) {
    for (size_t i = 0; i < p.track.size(); ++i) {
      ++num_points[p.track[i].keyframe];
      for (size_t j = i + 1; j < p.track.size(); ++j) ++shared[p.track[i].keyframe][p.track[j].keyframe];
    }
  }
  std::vector<std::vector<Eigen::Vector3d>> samples;
  for (int k = 0; k < n; ++k) samples.push_back(SamplePoints(map, k, options.num_samples));
  const auto fraction_inside = [&](int source, int target) {
    if (samples[source].empty()) return 0.0;
    int inside = 0;
    for (const Eigen::Vector3d& x : samples[source]) {
      inside += InImage(map.CameraOf(target), map.keyframes[target].cam_from_root * x);
    }
    return static_cast<double>(inside) / static_cast<double>(samples[source].size());
  };

  std::vector<std::vector<OverlappingPair>> partners(n);
  for (int a = 0; a < n; ++a) {
    for (int b = a + 1; b < n; ++b) {
      const double forth = fraction_inside(a, b);
      if (forth < options.min_overlap) continue;
      const double overlap = std::min(forth, fraction_inside(b, a));
      if (overlap < options.min_overlap) continue;
      const auto it = shared[a].find(b);
      const int num_shared = it == shared[a].end() ? 0 : it->second;
      const double possible = overlap * std::min(num_points[a], num_points[b]);
      if (num_shared > options.max_shared_fraction * possible) continue;
      partners[a].push_back({a, b, overlap, num_shared});
      partners[b].push_back({a, b, overlap, num_shared});
    }
  }
  std::map<std::pair<int, int>, OverlappingPair> chosen;
  for (std::vector<OverlappingPair>& list : partners) {
    std::stable_sort(list.begin(), list.end(),
                     [](const OverlappingPair& l, const OverlappingPair& r) { return l.overlap > r.overlap; });
    for (size_t i = 0; i < list.size() && i < static_cast<size_t>(options.max_partners); ++i) {
      chosen[{list[i].a, list[i].b}] = list[i];
    }
  }
  std::vector<OverlappingPair> pairs;
  for (const auto& [key, pair] : chosen) pairs.push_back(pair);
  return pairs;
}

std::vector<OverlapMatch> MatchOverlappingPair(const MergedMap& map, int a, int b,
                                               const OverlapMatchingOptions& options, SearchedKeyframes* searched) {
  const auto searched_a = searched->Get(a), searched_b = searched->Get(b);
  std::vector<OverlapMatch> matches;
  MatchOneWay(map, a, *searched_a, b, *searched_b, options, &matches);
  MatchOneWay(map, b, *searched_b, a, *searched_a, options, &matches);
  return matches;
}

OverlapFindings MatchOverlaps(const MergedMap& map, const OverlapOptions& overlap,
                              const OverlapMatchingOptions& matching, int min_points, SearchedKeyframes* searched) {
  OverlapFindings findings;
  for (const OverlappingPair& pair : FindOverlappingPairs(map, overlap)) {
    ++findings.num_pairs;
    const std::vector<OverlapMatch> matches = MatchOverlappingPair(map, pair.a, pair.b, matching, searched);
    findings.num_matched_pairs += !matches.empty();
    std::set<std::pair<int, int>> same;  // points that the one keyframe sees, and the other
    for (const OverlapMatch& m : matches) {
      const int other = map.point_of_feature[m.element.keyframe][m.element.feature];
      if (other == m.point) continue;
      if (other < 0) {
        findings.seen.Add({m.point, m.element});
        continue;
      }
      findings.same.Add(std::minmax(m.point, other));
      same.insert(m.element.keyframe == pair.b ? std::pair(m.point, other) : std::pair(other, m.point));
    }
    if (min_points <= 0 || static_cast<int>(same.size()) < min_points) continue;
    std::vector<Eigen::Vector3d> from, to;
    for (const auto& [a, b] : same) {
      from.push_back(map.points[a].position);
      to.push_back(map.points[b].position);
    }
    if (const auto fit = HornAlignment(from, to)) findings.relations.push_back({pair.a, pair.b, *fit});
  }
  searched->Close();
  return findings;
}

FusionSummary FuseOverlaps(OverlapFindings findings, MergedMap* map) {
  FusionSummary summary;
  summary.num_pairs = findings.num_pairs;
  summary.num_matched_pairs = findings.num_matched_pairs;
  std::vector<int> now(map->points.size());  // where a point has gone
  for (size_t i = 0; i < now.size(); ++i) now[i] = static_cast<int>(i);
  const auto find = [&](int p) {
    while (now[p] != p) p = now[p] = now[now[p]];
    return p;
  };
  for (const auto& [pair, count] : findings.same.TakeRanked()) {
    const int a = find(pair.first), b = find(pair.second);
    if (a == b) continue;
    const int into = std::min(a, b), from = std::max(a, b);
    if (FusePoints(into, from, map)) {
      now[from] = into;
      ++summary.num_fused;
    } else {
      ++summary.num_conflicts;
    }
  }
  for (const auto& [key, count] : findings.seen.TakeRanked()) {
    if (AddToTrack(find(key.first), key.second, map))
      ++summary.num_added;
    else
      ++summary.num_conflicts;
  }
  return summary;
}

}  // namespace mapmend

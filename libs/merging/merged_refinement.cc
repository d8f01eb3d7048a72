#include "libs/merging/merged_refinement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "libs/base/options.h"
#include "libs/base/text_format.h"
#include "libs/geometry/sim3_closed_form.h"

namespace mapmend {
namespace {

std::vector<PoseGraphEdge> Relations(const MergedMap& map, const std::vector<RefinementLink>& links,
                                     const KeyframeRelationOptions& options) {
  std::vector<PoseGraphEdge> edges;
  for (int s = 0, first = 0; s < static_cast<int>(map.submaps.size()); ++s) {
    AddTrackedRelations(*map.submaps[s].submap, first, options, &edges);
    first += static_cast<int>(map.submaps[s].submap->keyframes.size());
  }
  for (const RefinementLink& link : links) {
    const int a = map.FindKeyframe(link.submap_a, link.keyframe_a),
              b = map.FindKeyframe(link.submap_b, link.keyframe_b);
    if (a < 0 || b < 0) continue;  // culled since
    edges.push_back(VerifiedRelation(*map.submaps[link.submap_a].submap, link.keyframe_a, a,
                                     *map.submaps[link.submap_b].submap, link.keyframe_b, b, link.b_from_a,
                                     options.verified));
    edges.back().robust = link.robust;
  }
  return edges;
}

PoseGraphSummary SolvePoseGraph(const std::vector<PoseGraphEdge>& edges, const PoseGraphOptions& options,
                                MergedMap* map) {
  std::vector<Similarity3> vertices;
  for (const MergedKeyframe& k : map->keyframes) vertices.push_back(k.RootFromCam());
  const PoseGraphSummary summary = OptimizePoseGraph(edges, 0, options, &vertices);
  if (!summary.success) return summary;
  const std::vector<MergedKeyframe> before = map->keyframes;
  for (size_t k = 0; k < vertices.size(); ++k) {
    map->keyframes[k].scale = vertices[k].scale;
    map->keyframes[k].cam_from_root = Rigid3(vertices[k].rotation, vertices[k].translation).Inverse();
  }
  MovePointsWithKeyframes(before, map);
  return summary;
}

void AppendOverlaps(const MergedMap& map, const std::vector<OverlapRelation>& relations, const RelationSigmas& sigmas,
                    std::vector<PoseGraphEdge>* edges) {
  for (const OverlapRelation& r : relations) {
    const MergedKeyframe &from = map.keyframes[r.from], &to = map.keyframes[r.to];
    PoseGraphEdge edge;
    edge.a = r.from;
    edge.b = r.to;
    edge.b_from_a = to.RootFromCam().Inverse() * r.to_from_from * from.RootFromCam();
    edge.SetSigmas(sigmas, std::max(1e-9, MedianDepth(*map.submaps[to.submap].submap, *to.keyframe)));
    edge.robust = true;
    edges->push_back(edge);
  }
}

// One window around the seams after the other.
MergedBundleSummary AdjustWindows(const MergedBundleOptions& bundle, const SeamWindowOptions& options,
                                  const std::function<void(const std::string&)>& report, MergedMap* map) {
  MergedBundleSummary sum;
  sum.success = true;
  const std::vector<std::vector<int>> windows = ChooseSeamWindows(*map, options);
  for (const std::vector<int>& window : windows) {
    const MergedBundleSummary one = AdjustMergedMap(bundle, map, &window);
    sum.success = sum.success && one.success;
    sum.num_points += one.num_points;
    sum.num_observations += one.num_observations;
    sum.num_iterations += one.num_iterations;
    sum.initial_cost += one.initial_cost;
    sum.final_cost += one.final_cost;
    sum.num_removed += one.num_removed;
    report(Format("a window of %zu keyframes at the seams", window.size()));
  }
  return sum;
}

// Errors of the map's observations with other poses of its keyframes and points fitted to them; the map ends as it was.
ReprojectionStatistics MeasureWithPoses(const std::vector<MergedKeyframe>& keyframes, MergedMap* map) {
  std::vector<Eigen::Vector3d> positions;
  for (const MergedPoint& point : map->points) positions.push_back(point.position);
  const std::vector<MergedKeyframe> own = std::exchange(map->keyframes, keyframes);
  MovePointsWithKeyframes(own, map);
  RefinePoints(map);
  const ReprojectionStatistics statistics = MeasureReprojection(*map);
  map->keyframes = own;
  for (size_t i = 0; i < positions.size(); ++i) map->points[i].position = positions[i];
  return statistics;
}

// Similarity from a raw submap to the merged map that fits most of its points.
std::optional<Similarity3> FitSubmap(const MergedMap& map, int submap) {
  std::vector<Eigen::Vector3d> raw, merged;
  for (const MergedPoint& point : map.points) {
    if (point.track.empty()) continue;
    const auto add = [&](const std::pair<int, MapPointId>& member) {
      if (member.first != submap) return;
      raw.push_back(map.submaps[submap].submap->points.at(member.second).position.cast<double>());
      merged.push_back(point.position);
    };
    add(point.first);
    std::for_each(point.fused.begin(), point.fused.end(), add);
  }
  return RobustAlignment(raw, merged);
}

void TransformMap(const Similarity3& new_from_old, MergedMap* map) {
  for (MergedKeyframe& k : map->keyframes) {
    k.cam_from_root = TransformWorld(k.cam_from_root, new_from_old);
    k.scale *= new_from_old.scale;
  }
  for (MergedPoint& p : map->points) p.position = new_from_old * p.position;
}

}  // namespace

std::string MergedRefinementOptions::Check() const { return CheckOptions(*this); }

std::string MergedRefinementOptions::Conflict() const {
  if (!radii.empty() && radii.size() == iterations.size()) return "";
  return "radii and iterations must have the same, positive length";
}

MergedRefinementResult RefineMergedMap(const std::vector<SubmapView>& submaps,
                                       const std::vector<Similarity3>& root_from_submap,
                                       const std::vector<RefinementLink>& links, const MergedRefinementOptions& options,
                                       const std::function<void(const std::string&)>& progress,
                                       const OpenFeatureSource& open_features) {
  const auto report = [&](const std::string& text) {
    if (progress) progress(text);
  };
  MergedRefinementResult result;
  MergedRefinementSummary& summary = result.summary;
  result.root_from_submap = root_from_submap;
  MergedMap map = MakeMergedMap(submaps, root_from_submap, open_features);
  const auto keep_tree = [&] { result.map = MakeMergedMap(submaps, root_from_submap, open_features); };
  if (map.keyframes.empty() || map.points.empty()) {
    summary.reason = "nothing to refine";
    result.map = std::move(map);
    return result;
  }
  if (options.find_readouts) MeasureMotions(&map);
  const std::vector<MergedKeyframe> tree_keyframes = map.keyframes;
  SearchedKeyframes searched(map, open_features);

  std::vector<PoseGraphEdge> edges =
      links.empty() ? std::vector<PoseGraphEdge>() : Relations(map, links, options.relations);
  if (!edges.empty()) {
    report(Format("pose graph of %zu keyframes and %zu relations", map.keyframes.size(), edges.size()));
    summary.pose_graph = SolvePoseGraph(edges, options.pose_graph, &map);
  }
  const int num_keyframes = static_cast<int>(map.keyframes.size());
  const bool is_large = num_keyframes > options.max_keyframes_without_overlaps;
  const bool by_overlaps = is_large && summary.pose_graph.success;
  const size_t num_links_and_tracked = edges.size();
  const auto match = [&](double radius) {
    OverlapMatchingOptions matching = options.matching;
    matching.radius = radius;
    return MatchOverlaps(map, options.overlap, matching, by_overlaps ? options.min_points_of_overlap : 0, &searched);
  };
  // The links hold the submaps together at a few places each; their overlaps do so all along, which straightens what
  // bundle adjustment would need very many steps for.
  const auto straighten = [&](const std::vector<OverlapRelation>& relations) {
    edges.resize(num_links_and_tracked);
    AppendOverlaps(map, relations, options.overlapping, &edges);
    report(Format("pose graph of %zu keyframes and %zu relations, overlaps among them", map.keyframes.size(),
                  edges.size()));
    summary.pose_graph = SolvePoseGraph(edges, options.pose_graph, &map);
  };
  if (by_overlaps) {
    const std::vector<OverlapRelation> relations = match(options.radii[0]).relations;
    straighten(relations);
  }

  const bool by_windows = num_keyframes > options.max_keyframes_at_once;
  // With poses beyond the window fixed, further rounds move nothing.
  const size_t num_rounds = by_windows ? 1 : options.radii.size();
  // Fusion of what lies on each other, and bundle adjustment.
  const auto adjust = [&](size_t round) {
    report(Format("fusion of duplicate points, round %zu of %zu", round + 1, num_rounds));
    OverlapFindings findings = match(options.radii[round]);
    // Measured on a straighter map than the first time, overlaps say more.
    if (by_overlaps && round == 0) straighten(findings.relations);
    summary.fusions.push_back(FuseOverlaps(std::move(findings), &map));
    const FusionSummary& fusion = summary.fusions.back();
    report(Format("%d of %d overlapping pairs matched, %d points fused, %d observations added, %d conflicts",
                  fusion.num_matched_pairs, fusion.num_pairs, fusion.num_fused, fusion.num_added,
                  fusion.num_conflicts));
    MergedBundleOptions bundle = options.bundle;
    bundle.bundle.max_iterations = options.iterations[round];
    if (is_large) bundle.bundle.initial_trust_radius = options.large_trust_radius;
    const bool last = round + 1 == num_rounds;
    if (last && num_keyframes <= options.max_keyframes_with_all_points) bundle.points_per_keyframe = 0;
    report(Format("bundle adjustment, round %zu of %zu", round + 1, num_rounds));
    summary.bundles.push_back(by_windows ? AdjustWindows(bundle, options.windows, report, &map)
                                         : AdjustMergedMap(bundle, &map));
    const MergedBundleSummary& adjusted = summary.bundles.back();
    report(Format("%d points, %d observations, %d iterations, cost %.0f to %.0f, %d outliers removed",
                  adjusted.num_points, adjusted.num_observations, adjusted.num_iterations, adjusted.initial_cost,
                  adjusted.final_cost, adjusted.num_removed));
    return adjusted.success;
  };
  const auto give_up = [&] {
    summary.reason = "bundle adjustment failed; the transforms along the tree stand";
    keep_tree();
    return result;
  };
  for (size_t round = 0; round < num_rounds; ++round) {
    if (!adjust(round)) return give_up();
  }
  // Only now, for what an image read row by row does to a map that is still bent cannot be told.
  if (options.find_readouts && !by_windows) {
    MergedBundleOptions bundle = options.bundle;
    bundle.find_readouts = true;
    bundle.bundle.max_iterations = options.readout_iterations;
    if (is_large) bundle.bundle.initial_trust_radius = options.large_trust_radius;
    const MergedBundleSummary found = AdjustMergedMap(bundle, &map);
    report(Format("rolling shutter: %s; %d iterations, cost %.0f to %.0f", found.reason.c_str(), found.num_iterations,
                  found.initial_cost, found.final_cost));
    if (found.success && !adjust(num_rounds - 1)) return give_up();
  }

  // Was it worth it? The same observations, with the poses of the tree.
  RefinePoints(&map);
  summary.after = MeasureReprojection(map);
  summary.before = MeasureWithPoses(tree_keyframes, &map);
  constexpr double kNoise = 1.01;  // a map without drift can only stay as good as it is
  if (summary.after.mean_robust > kNoise * summary.before.mean_robust) {
    summary.reason =
        Format("refinement would raise the reprojection error from %.2f to %.2f px; the tree's transforms stand",
               summary.before.median_px, summary.after.median_px);
    keep_tree();
    return result;
  }

  // The frame stays that of the root submap.
  if (const std::optional<Similarity3> refined_from_root = FitSubmap(map, 0)) {
    TransformMap(refined_from_root->Inverse(), &map);
  }
  for (size_t s = 1; s < submaps.size(); ++s) {
    if (const auto fit = FitSubmap(map, static_cast<int>(s))) result.root_from_submap[s] = *fit;
  }
  result.map = std::move(map);
  summary.success = true;
  summary.reason = Format("median reprojection error %.2f px before, %.2f px after, over %d observations",
                          summary.before.median_px, summary.after.median_px, summary.after.num_observations);
  return result;
}

}  // namespace mapmend

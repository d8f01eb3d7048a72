#include "libs/merging/merged_refinement.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "libs/base/options.h"
#include "libs/base/text_format.h"
#include "libs/geometry/sim3_closed_form.h"

namespace mapmend {
namespace {

RelationSigmas LargerOf(const RelationSigmas& a, const RelationSigmas& b) {
  return {std::max(a.rotation, b.rotation), std::max(a.translation, b.translation), std::max(a.scale, b.scale)};
}

PoseGraphSummary SolvePoseGraph(const std::vector<PoseGraphEdge>& edges, const PoseGraphOptions& options,
                                const std::vector<PositionPrior>& positions, MergedMap* map) {
  std::vector<Similarity3> vertices;
  for (const MergedKeyframe& k : map->keyframes) vertices.push_back(k.RootFromCam());
  const PoseGraphSummary summary = positions.empty() ? OptimizePoseGraph(edges, 0, options, &vertices)
                                                     : OptimizePoseGraph(edges, -1, options, &vertices, &positions);
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

// What wide features see on both sides of a gap takes part like any other point.
void AddWidePoints(const std::vector<RefinementLink>& links, MergedMap* map) {
  std::set<const WideCommonPoints*> known;
  for (const RefinementLink& link : links) {
    if (link.wide != nullptr && known.insert(link.wide.get()).second)
      AddWidePoints(*link.wide, link.submap_a, link.submap_b, map);
  }
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
      if (member.first != submap || !member.second.IsValid()) return;
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

// Refines one map, step by step.
class Refinement {
 public:
  Refinement(const std::vector<SubmapView>& submaps, const std::vector<Similarity3>& root_from_submap,
             const MergedRefinementOptions& options, const std::function<void(const std::string&)>& progress,
             const OpenFeatureSource& open_features, const FlightPositions& positions)
      : submaps_(submaps),
        options_(options),
        progress_(progress),
        open_features_(open_features),
        positions_(positions),
        map_(MakeMergedMap(submaps, root_from_submap, open_features)),
        searched_(map_, open_features),
        num_keyframes_(static_cast<int>(map_.keyframes.size())),
        is_large_(num_keyframes_ > options.max_keyframes_without_overlaps),
        by_windows_(num_keyframes_ > options.max_keyframes_at_once),
        // With poses beyond the window fixed, further rounds move nothing.
        num_rounds_(by_windows_ ? 1 : options.radii.size()) {
    result_.root_from_submap = root_from_submap;
  }

  MergedRefinementResult Run(const std::vector<RefinementLink>& links);

 private:
  void Report(const std::string& text) const {
    if (progress_) progress_(text);
  }
  // Pose graph of what tracking and the links say; large maps are straightened by their overlaps at once.
  void SolveLinks(const std::vector<RefinementLink>& links);
  // The links hold the submaps together at a few places each; their overlaps do so all along, which straightens what
  // bundle adjustment would need very many steps for.
  void Straighten(const std::vector<OverlapRelation>& relations);
  OverlapFindings Match(double radius);
  // Where receivers say that the keyframes were. The map is placed anew each time, because it has changed.
  std::vector<PositionPrior> FindPositions() const;
  void Fuse(size_t round);
  // Fusion of what lies on each other, and bundle adjustment. False: it failed.
  bool Adjust(size_t round);
  bool FindShutters();
  MergedBundleOptions BundleOptions(int max_iterations) const;
  // The same observations, with the poses of the tree. False: refinement was not worth it.
  bool Compare(const std::vector<MergedKeyframe>& tree_keyframes);
  void KeepFrameOfRoot();
  MergedRefinementResult GiveUp(const std::string& reason);

  const std::vector<SubmapView>& submaps_;
  const MergedRefinementOptions& options_;
  const std::function<void(const std::string&)>& progress_;
  const OpenFeatureSource& open_features_;
  const FlightPositions& positions_;
  MergedRefinementResult result_;
  MergedMap map_;
  SearchedKeyframes searched_;
  const int num_keyframes_;
  const bool is_large_, by_windows_;
  const size_t num_rounds_;
  bool by_overlaps_ = false;
  std::vector<PoseGraphEdge> edges_;  // of tracking and links, then of overlaps
  size_t num_links_and_tracked_ = 0;
};

MergedRefinementResult Refinement::Run(const std::vector<RefinementLink>& links) {
  if (map_.keyframes.empty() || map_.points.empty()) {
    result_.summary.reason = "nothing to refine";
    result_.map = std::move(map_);
    return std::move(result_);
  }
  if (options_.shutter.use) MeasureMotions(&map_);
  AddWidePoints(links, &map_);
  const std::vector<MergedKeyframe> tree_keyframes = map_.keyframes;
  SolveLinks(links);
  bool success = true;
  for (size_t round = 0; round < num_rounds_ && success; ++round) success = Adjust(round);
  // Only now, for what an image read row by row does to a map that is still bent cannot be told.
  if (success && options_.shutter.use && !by_windows_ && FindShutters()) success = Adjust(num_rounds_ - 1);
  if (!success) return GiveUp("bundle adjustment failed; the transforms along the tree stand");
  if (!Compare(tree_keyframes)) {
    return GiveUp(
        Format("refinement would raise the reprojection error from %.2f to %.2f px; the tree's transforms stand",
               result_.summary.before.median_px, result_.summary.after.median_px));
  }
  KeepFrameOfRoot();
  result_.map = std::move(map_);
  MergedRefinementSummary& summary = result_.summary;
  summary.success = true;
  summary.reason = Format("median reprojection error %.2f px before, %.2f px after, over %d observations",
                          summary.before.median_px, summary.after.median_px, summary.after.num_observations);
  return std::move(result_);
}

void Refinement::SolveLinks(const std::vector<RefinementLink>& links) {
  if (!links.empty()) edges_ = RefinementRelations(map_, links, options_.relations);
  num_links_and_tracked_ = edges_.size();
  if (!edges_.empty()) {
    Report(Format("pose graph of %zu keyframes and %zu relations", map_.keyframes.size(), edges_.size()));
    result_.summary.pose_graph = SolvePoseGraph(edges_, options_.pose_graph, {}, &map_);
    // Once more with the positions, which a map that is bent less fits better.
    if (const std::vector<PositionPrior> priors = FindPositions(); !priors.empty())
      result_.summary.pose_graph = SolvePoseGraph(edges_, options_.pose_graph, priors, &map_);
  }
  by_overlaps_ = is_large_ && result_.summary.pose_graph.success;
  if (by_overlaps_) Straighten(Match(options_.radii[0]).relations);
}

void Refinement::Straighten(const std::vector<OverlapRelation>& relations) {
  edges_.resize(num_links_and_tracked_);
  AppendOverlaps(map_, relations, options_.overlapping, &edges_);
  Report(Format("pose graph of %zu keyframes and %zu relations, overlaps among them", map_.keyframes.size(),
                edges_.size()));
  result_.summary.pose_graph = SolvePoseGraph(edges_, options_.pose_graph, FindPositions(), &map_);
}

std::vector<PositionPrior> Refinement::FindPositions() const {
  if (positions_.empty() || !options_.positions.use) return {};
  MapPositions found = FindMapPositions(map_, positions_, options_.positions);
  if (!found.told.empty()) Report(found.told);
  return std::move(found.priors);
}

OverlapFindings Refinement::Match(double radius) {
  OverlapMatchingOptions matching = options_.matching;
  matching.radius = radius;
  return MatchOverlaps(map_, options_.overlap, matching, by_overlaps_ ? options_.min_points_of_overlap : 0, &searched_);
}

void Refinement::Fuse(size_t round) {
  Report(Format("fusion of duplicate points, round %zu of %zu", round + 1, num_rounds_));
  OverlapFindings findings = Match(options_.radii[round]);
  // Measured on a straighter map than the first time, overlaps say more.
  if (by_overlaps_ && round == 0) Straighten(findings.relations);
  result_.summary.fusions.push_back(FuseOverlaps(std::move(findings), &map_));
  const FusionSummary& fusion = result_.summary.fusions.back();
  Report(Format("%d of %d overlapping pairs matched, %d points fused, %d observations added, %d conflicts",
                fusion.num_matched_pairs, fusion.num_pairs, fusion.num_fused, fusion.num_added, fusion.num_conflicts));
}

MergedBundleOptions Refinement::BundleOptions(int max_iterations) const {
  MergedBundleOptions bundle = options_.bundle;
  bundle.bundle.max_iterations = max_iterations;
  if (is_large_) bundle.bundle.initial_trust_radius = options_.large_trust_radius;
  return bundle;
}

bool Refinement::Adjust(size_t round) {
  Fuse(round);
  MergedBundleOptions bundle = BundleOptions(options_.iterations[round]);
  const bool last = round + 1 == num_rounds_;
  if (last && num_keyframes_ <= options_.max_keyframes_with_all_points) bundle.points_per_keyframe = 0;
  const std::vector<PositionPrior> priors = by_windows_ ? std::vector<PositionPrior>() : FindPositions();
  Report(Format("bundle adjustment, round %zu of %zu", round + 1, num_rounds_));
  const auto report = [this](const std::string& text) { Report(text); };
  result_.summary.bundles.push_back(by_windows_ ? AdjustWindows(bundle, options_.windows, report, &map_)
                                                : AdjustMergedMap(bundle, &map_, nullptr, &priors));
  const MergedBundleSummary& adjusted = result_.summary.bundles.back();
  Report(Format("%d points, %d observations, %d iterations, cost %.0f to %.0f, %d outliers removed",
                adjusted.num_points, adjusted.num_observations, adjusted.num_iterations, adjusted.initial_cost,
                adjusted.final_cost, adjusted.num_removed));
  return adjusted.success;
}

bool Refinement::FindShutters() {
  const ShutterFindings findings =
      mapmend::FindShutters(BundleOptions(options_.shutter.iterations), options_.shutter, &map_);
  Report("rolling shutter: " + findings.told);
  return findings.found;
}

bool Refinement::Compare(const std::vector<MergedKeyframe>& tree_keyframes) {
  RefinePoints(&map_);
  result_.summary.after = MeasureReprojection(map_);
  result_.summary.before = MeasureWithPoses(tree_keyframes, &map_);
  constexpr double kNoise = 1.01;  // a map without drift can only stay as good as it is
  return result_.summary.after.mean_robust <= kNoise * result_.summary.before.mean_robust;
}

void Refinement::KeepFrameOfRoot() {
  if (const std::optional<Similarity3> refined_from_root = FitSubmap(map_, 0)) {
    TransformMap(refined_from_root->Inverse(), &map_);
  }
  for (size_t s = 1; s < submaps_.size(); ++s) {
    if (const auto fit = FitSubmap(map_, static_cast<int>(s))) result_.root_from_submap[s] = *fit;
  }
}

MergedRefinementResult Refinement::GiveUp(const std::string& reason) {
  result_.summary.reason = reason;
  result_.map = MakeMergedMap(submaps_, result_.root_from_submap, open_features_);
  return std::move(result_);
}

}  // namespace

std::string MergedRefinementOptions::Check() const { return CheckOptions(*this); }

std::string MergedRefinementOptions::Conflict() const {
  if (!radii.empty() && radii.size() == iterations.size()) return "";
  return "radii and iterations must have the same, positive length";
}

std::vector<PoseGraphEdge> RefinementRelations(const MergedMap& map, const std::vector<RefinementLink>& links,
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
                                     LargerOf(link.sigmas, options.verified)));
    edges.back().robust = link.robust;
  }
  return edges;
}

MergedRefinementResult RefineMergedMap(const std::vector<SubmapView>& submaps,
                                       const std::vector<Similarity3>& root_from_submap,
                                       const std::vector<RefinementLink>& links, const MergedRefinementOptions& options,
                                       const std::function<void(const std::string&)>& progress,
                                       const OpenFeatureSource& open_features, const FlightPositions& positions) {
  return Refinement(submaps, root_from_submap, options, progress, open_features, positions).Run(links);
}

}  // namespace mapmend

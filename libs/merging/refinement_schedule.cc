#include "libs/merging/refinement_schedule.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "libs/base/options.h"
#include "libs/connecting/seam.h"

namespace mapmend {
namespace {

// A submap that grows, as it is now, without what only the final refinement looks at. `searchable`: with the features
// too.
std::shared_ptr<const Submap> Copy(const Submap& submap, bool searchable) {
  auto copy = std::make_shared<Submap>();
  copy->id = submap.id;
  copy->points = submap.points;
  copy->has_observations = submap.has_observations;
  for (const auto& [id, keyframe] : submap.keyframes) {
    SubmapKeyframe& k = copy->keyframes[id];
    k.id = id;
    k.seq = keyframe.seq;
    k.cam_from_submap = keyframe.cam_from_submap;
    k.map_points = keyframe.map_points;
    if (searchable) k.features = keyframe.features;
  }
  return copy;
}

int NumJoinedKeyframes(const Sessions& sessions, const ConnectionGraph& graph) {
  std::set<SubmapKey> joined;
  for (const SubmapPair& pair : graph.TreePairs()) joined.insert({pair.older, pair.younger});
  int num_keyframes = 0;
  for (const SubmapKey& key : joined)
    num_keyframes += static_cast<int>(ViewSubmap(sessions, key).submap->keyframes.size());
  return num_keyframes;
}

// What one piece of evidence leaves open. All pieces of a wide connection are one estimate, of which each has its part.
RelationSigmas EvidenceSigmas(const Submap& older, const Submap& younger, const Connection& connection,
                              const ConnectedFrames& e) {
  Matrix7d covariance = TransformCovariance(e.information, e.median_error_px);
  if (e.wide != nullptr) covariance *= connection.num_connected_frames;
  return SigmasAt(e.b_from_a, covariance, older.keyframes.at(e.keyframe_a).cam_from_submap.Center(),
                  std::max(1e-9, MedianDepth(younger, younger.keyframes.at(e.keyframe_b))));
}

// The evidence that agrees, of connections and loops that are used.
void AddLinks(const Sessions& sessions, const ConnectionGraph& graph, const std::map<SubmapKey, int>& index,
              std::vector<RefinementLink>* links) {
  for (const auto& [pair, connection] : graph.connections()) {
    if (connection.verdict != Connection::Verdict::kAccepted) continue;
    const Submap &older = *ViewSubmap(sessions, pair.older).submap,
                 &younger = *ViewSubmap(sessions, pair.younger).submap;
    for (size_t i = 0; i < connection.evidence.size(); ++i) {
      const ConnectedFrames& e = connection.evidence[i];
      const bool was_culled = !older.keyframes.contains(e.keyframe_a) || !younger.keyframes.contains(e.keyframe_b);
      if (connection.agrees[i] && !was_culled) {
        links->push_back({index.at(pair.older), index.at(pair.younger), e.keyframe_a, e.keyframe_b, e.b_from_a, true,
                          e.wide, EvidenceSigmas(older, younger, connection, e)});
      }
    }
  }
  for (const auto& [key, loops] : graph.loops()) {
    if (loops.verdict != Connection::Verdict::kAccepted) continue;
    const int s = index.at(key);
    for (size_t i = 0; i < loops.evidence.size(); ++i) {
      const ConnectedFrames& e = loops.evidence[i];
      if (loops.agrees[i]) links->push_back({s, s, e.keyframe_a, e.keyframe_b, e.b_from_a, false});
    }
  }
}

// Per component its number among all, by the frames it holds, most first (ties: the lower component).
std::vector<int> RankByFrames(const Sessions& sessions, const std::vector<SubmapKey>& keys,
                              const std::vector<int>& component, int num_components) {
  std::vector<std::pair<long, int>> frames(num_components);
  for (int c = 0; c < num_components; ++c) frames[c].second = c;
  for (size_t i = 0; i < keys.size(); ++i)
    frames[component[i]].first -= static_cast<long>(ViewSubmap(sessions, keys[i]).submap->frames.size());
  std::stable_sort(frames.begin(), frames.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<int> rank(num_components);
  for (int r = 0; r < num_components; ++r) rank[frames[r].second] = r;
  return rank;
}

}  // namespace

RefinementScheduleOptions::RefinementScheduleOptions() {
  live.radii = {16, 8};
  live.iterations = {5, 8};
  live.max_keyframes_with_all_points = 0;
  live.max_keyframes_at_once = 600;
  live.windows.max_windows = 4;
  live.shutter.use = false;
  live.positions.use = false;
}

std::string RefinementScheduleOptions::Check() const { return CheckOptions(*this); }

bool RefinementSchedule::IsDue(const Sessions& sessions, const ConnectionGraph& graph) const {
  const int num_keyframes = NumJoinedKeyframes(sessions, graph);
  if (num_keyframes == 0) return false;
  return graph.TreePairs() != begun_.tree || num_keyframes >= options_.live_growth * begun_.num_keyframes;
}

RefinementTask RefinementSchedule::Begin(const Sessions& sessions, const ConnectionGraph& graph,
                                         MergedTransforms transforms, bool is_complete, bool copy_features) {
  begun_ = {{}, {}, graph.TreePairs(), NumJoinedKeyframes(sessions, graph)};
  for (const auto& [pair, connection] : graph.connections()) {
    if (connection.verdict == Connection::Verdict::kAccepted) begun_.pairs.insert(pair);
  }
  RefinementTask task;
  task.options = is_complete ? options_.final_map : options_.live;
  task.transforms = std::move(transforms);
  std::map<SubmapKey, int> index;
  for (const MergedTransforms::Place& place : task.transforms.submaps) {
    index[place.key] = static_cast<int>(task.parts.size());
    const SubmapView view = ViewSubmap(sessions, place.key);
    // An ended submap stays where it is and as it is.
    const auto submap = view.submap->ended ? std::shared_ptr<const Submap>(std::shared_ptr<void>(), view.submap)
                                           : Copy(*view.submap, copy_features);
    task.parts.push_back({submap, view.camera, view.pyramid, view.real});
  }
  AddLinks(sessions, graph, index, &task.links);
  for (const auto& [id, session] : sessions) {
    if (is_complete && task.options.positions.use && !session.positions.empty()) task.positions[id] = session.positions;
  }
  return task;
}

bool RefinementSchedule::Take(const RefinementOutcome& outcome, const ConnectionGraph& graph) {
  for (const SubmapPair& pair : begun_.pairs) {
    if (!graph.IsAccepted(pair)) return false;
  }
  taken_ = begun_;
  for (const MergedTransforms::Place& place : outcome.transforms.submaps)
    taken_.places[place.key] = {place.component, place.root_from_submap};
  return true;
}

void RefinementSchedule::OnGraphChange(const ConnectionGraph& graph) {
  const bool all_hold = std::all_of(taken_.pairs.begin(), taken_.pairs.end(),
                                    [&](const SubmapPair& pair) { return graph.IsAccepted(pair); });
  if (!all_hold) Forget();
}

MergedTransforms PlaceSubmaps(const Sessions& sessions, const ConnectionGraph& graph,
                              const std::map<SubmapKey, RefinedPlace>& refined) {
  const std::vector<SubmapKey> keys = SubmapsByAge(sessions);
  std::vector<RefinedPlace> known(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    if (const auto it = refined.find(keys[i]); it != refined.end()) known[i] = it->second;
  }
  const std::vector<MergedPlace> places = ComposeAlongForest(static_cast<int>(keys.size()), graph.tree(), known);

  // A submap that began after the graph was solved is a component of its own.
  std::vector<int> component(graph.forest().component);
  int num_components = graph.forest().num_components;
  while (component.size() < keys.size()) component.push_back(num_components++);
  const std::vector<int> rank = RankByFrames(sessions, keys, component, num_components);

  MergedTransforms transforms;
  transforms.cursors = CursorsOf(sessions);
  for (size_t i = 0; i < keys.size(); ++i) {
    transforms.submaps.push_back(
        {keys[i], rank[component[i]], places[i].root_from_vertex, places[i].root == static_cast<int>(i)});
  }
  for (const TreeEdge& e : graph.tree()) transforms.edges.push_back({e.a, e.b});
  return transforms;
}

}  // namespace mapmend

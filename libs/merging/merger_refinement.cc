#include <memory>
#include <set>
#include <vector>

#include "libs/merging/merger.h"

// The part of the merger that decides when the merged map is refined, and takes the result in.
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

}  // namespace

std::set<Merger::PairKey> Merger::TreePairs() const {
  std::set<PairKey> pairs;
  for (const auto& [pair, connection] : connections_) {
    if (connection.in_tree) pairs.insert(pair);
  }
  return pairs;
}

int Merger::NumJoinedKeyframes() const {
  std::set<SubmapKey> joined;
  for (const PairKey& pair : TreePairs()) joined.insert({pair.first, pair.second});
  int num_keyframes = 0;
  for (const SubmapKey& key : joined) num_keyframes += static_cast<int>(View(key).submap->keyframes.size());
  return num_keyframes;
}

bool Merger::RefinementIsDue() const {
  if (complete_) return !transforms_.is_final || transforms_.revision < 2 * (num_records_ + num_decisions_) + 1;
  if (sessions_.empty() || AllEnded()) return false;
  const int num_keyframes = NumJoinedKeyframes();
  if (num_keyframes == 0) return false;
  return TreePairs() != live_task_.tree || num_keyframes >= options_.live_growth * live_task_.num_keyframes;
}

RefinementTask Merger::MakeRefinement() {
  RefinementTask task;
  task.state = state_;
  task.is_final = complete_ && AllEnded();
  task.options = complete_ ? options_.refinement : options_.live_refinement;
  task.transforms = PlaceSubmaps();
  live_task_ = {{}, {}, TreePairs(), NumJoinedKeyframes()};
  std::map<SubmapKey, int> index;
  for (const MergedTransforms::Place& place : task.transforms.submaps) {
    index[place.key] = static_cast<int>(task.parts.size());
    const SubmapView view = View(place.key);
    // An ended submap stays where it is and as it is.
    const auto submap = view.submap->ended ? std::shared_ptr<const Submap>(std::shared_ptr<void>(), view.submap)
                                           : Copy(*view.submap, keyframes_ == nullptr);
    task.parts.push_back({submap, view.camera, view.pyramid, view.real});
  }
  for (const auto& [pair, connection] : connections_) {
    if (connection.verdict != Connection::Verdict::kAccepted) continue;
    live_task_.pairs.insert(pair);
    for (size_t i = 0; i < connection.evidence.size(); ++i) {
      const ConnectedFrames& e = connection.evidence[i];
      const bool was_culled = !View(pair.first).submap->keyframes.contains(e.keyframe_a) ||
                              !View(pair.second).submap->keyframes.contains(e.keyframe_b);
      if (connection.agrees[i] && !was_culled) {
        task.links.push_back({index.at(pair.first), index.at(pair.second), e.keyframe_a, e.keyframe_b, e.b_from_a});
      }
    }
  }
  for (const auto& [key, loops] : loops_) {
    if (loops.verdict != Connection::Verdict::kAccepted) continue;
    const int s = index.at(key);
    for (size_t i = 0; i < loops.evidence.size(); ++i) {
      const ConnectedFrames& e = loops.evidence[i];
      if (loops.agrees[i]) task.links.push_back({s, s, e.keyframe_a, e.keyframe_b, e.b_from_a, false});
    }
  }
  return task;
}

bool Merger::TakeRefinement(const RefinementOutcome& outcome) {
  const int64_t number = 2 * (num_records_ + num_decisions_) + 1;
  MergedTransforms refined;
  if (outcome.is_final) {
    if (outcome.state != state_) return false;
    refined = outcome.transforms;
    refined.is_final = true;
    readouts_ = outcome.readouts;
  } else {
    // The final revision will have the number that a revision made now would get.
    if (complete_ || AllEnded() || number <= transforms_.revision) return false;
    for (const PairKey& pair : live_task_.pairs) {
      const auto it = connections_.find(pair);
      if (it == connections_.end() || it->second.verdict != Connection::Verdict::kAccepted) return false;
    }
    live_ = live_task_;
    for (const MergedTransforms::Place& place : outcome.transforms.submaps) {
      live_.places[place.key] = {place.component, place.root_from_submap};
    }
    refined = PlaceSubmaps();
  }
  refined.revision = number;
  refined.cursors = Cursors();
  refined.refined = true;
  transforms_ = refined;
  output_->OnRevision(refined, connections(), outcome.submaps);
  return true;
}

void Merger::Finalize() {
  // The source is not ours: what is opened is a view of it.
  struct Borrowed : KeyframeSource {
    explicit Borrowed(KeyframeSource* from) : source(from) {}
    KeyframeRecord Read(const std::string& session, int64_t seq) override { return source->Read(session, seq); }
    KeyframeSource* source;
  };
  OpenKeyframeSource open;
  if (keyframes_) open = [this] { return std::make_unique<Borrowed>(keyframes_); };
  Complete();
  TakeRefinement(RunRefinement(
      MakeRefinement(), [&](const std::string& what) { output_->OnProgress(what); }, open));
}

}  // namespace mapmend

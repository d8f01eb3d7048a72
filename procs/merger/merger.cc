#include "procs/merger/merger.h"

#include <algorithm>
#include <tuple>

namespace mapmend {
namespace {

// Common points (frame of a) spread over the evidence, for the cycle check.
std::vector<Eigen::Vector3d> Probes(const Connection& c, const Submap& a) {
  std::vector<Eigen::Vector3d> all;
  for (size_t i = 0; i < c.evidence.size(); ++i) {
    if (!c.agrees[i]) continue;
    for (const auto& [point, other] : c.evidence[i].common_points) {
      const auto it = a.points.find(point);
      if (it != a.points.end()) all.push_back(it->second.position);
    }
  }
  constexpr size_t kMaxProbes = 30;
  std::vector<Eigen::Vector3d> probes;
  const size_t n = std::min(all.size(), kMaxProbes);
  for (size_t i = 0; i < n; ++i) probes.push_back(all[i * all.size() / n]);
  return probes;
}

double ViewingDistance(const Connection& c, const Submap& a) {
  for (size_t i = 0; i < c.evidence.size(); ++i) {
    if (!c.agrees[i]) continue;
    const auto it = a.keyframes.find(c.evidence[i].keyframe_a);
    if (it == a.keyframes.end()) continue;
    const double depth = MedianDepth(a, it->second);
    if (depth > 0) return depth;
  }
  return 1;
}

bool SamePlaces(const MergedTransforms& l, const MergedTransforms& r) {
  if (l.submaps.size() != r.submaps.size() || l.edges != r.edges || l.refined != r.refined) return false;
  for (size_t i = 0; i < l.submaps.size(); ++i) {
    if (l.submaps[i].key != r.submaps[i].key || l.submaps[i].component != r.submaps[i].component ||
        ToArray(l.submaps[i].root_from_submap) != ToArray(r.submaps[i].root_from_submap)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string MergerOptions::Check() const {
  if (const std::string e = connected_frames.Check(); !e.empty()) return "connected_frames: " + e;
  if (const std::string e = cycles.Check(); !e.empty()) return "cycles: " + e;
  if (const std::string e = refinement.Check(); !e.empty()) return "refinement: " + e;
  if (max_proposals < 1 || max_verified_per_submap < 1 || max_accepted_per_submap < 1 || max_evidence < 1) {
    return "the limits must be positive";
  }
  return "";
}

Merger::Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output)
    : options_(options), bow_(bow), output_(output) {}

SubmapView Merger::View(const SubmapKey& key) const {
  const Session& session = sessions_.at(key.session);
  return {&session.submaps.at(key.submap), session.info.pinhole, session.info.pyramid};
}

bool Merger::IsOlder(const SubmapKey& l, const SubmapKey& r) const {
  return std::tuple(sessions_.at(l.session).start_utime, l) < std::tuple(sessions_.at(r.session).start_utime, r);
}

std::vector<SubmapKey> Merger::OrderedSubmaps() const {
  std::vector<SubmapKey> keys;
  for (const auto& [id, session] : sessions_) {
    for (const auto& [submap_id, submap] : session.submaps) keys.push_back({id, submap_id});
  }
  std::sort(keys.begin(), keys.end(), [&](const SubmapKey& l, const SubmapKey& r) { return IsOlder(l, r); });
  return keys;
}

std::vector<MergerCursor> Merger::Cursors() const {
  std::vector<MergerCursor> cursors;
  for (const auto& [id, session] : sessions_) cursors.push_back({id, session.last_seq});
  return cursors;
}

bool Merger::AllEnded() const {
  return !sessions_.empty() && std::all_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s.second.ended; });
}

int Merger::num_accepted() const {
  return static_cast<int>(std::count_if(connections_.begin(), connections_.end(), [](const auto& c) {
    return c.second.verdict == Connection::Verdict::kAccepted;
  }));
}

std::string Merger::Consume(const Record& record) {
  const std::string& id = record.header.session;
  if (record.header.seq != 0 && !sessions_.contains(id)) return "session " + id + " has not started";
  Session& session = sessions_[id];
  const std::string error = session.Apply(record);
  if (!error.empty()) {
    if (session.last_seq < 0) sessions_.erase(id);
    return error;
  }
  ++num_records_;
  std::set<PairKey> evaluated;
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    EvaluatePending(id, &evaluated);
    pending_[id] = {keyframe->submap, keyframe->keyframe};
    Update(evaluated, false);
  } else if (const auto* end = std::get_if<SubmapEnded>(&record.body)) {
    EvaluatePending(id, &evaluated);
    EvaluateAgain(id, end->submap, &evaluated);
    Update(evaluated, false);
  }
  return "";
}

void Merger::EvaluatePending(const std::string& session, std::set<PairKey>* evaluated) {
  const auto it = pending_.find(session);
  if (it == pending_.end()) return;
  const Pending pending = it->second;
  pending_.erase(it);
  Evaluate(session, pending.submap, pending.keyframe, false, evaluated);
}

void Merger::EvaluateAgain(const std::string& session, SubmapId submap_id, std::set<PairKey>* evaluated) {
  std::vector<KeyframeId> open;
  for (const auto& [id, keyframe] : sessions_.at(session).submaps.at(submap_id).keyframes) {
    if (!connected_.contains({session, id})) open.push_back(id);
  }
  const size_t n = std::min(open.size(), static_cast<size_t>(options_.max_evaluated_again));
  for (size_t i = 0; i < n; ++i) Evaluate(session, submap_id, open[i * open.size() / n], false, evaluated);
}

void Merger::Evaluate(const std::string& session, SubmapId submap, KeyframeId keyframe, bool same_submap,
                      std::set<PairKey>* evaluated) {
  if (!sessions_.at(session).submaps.at(submap).keyframes.contains(keyframe)) return;  // culled before its turn
  const SubmapKey query{session, submap};
  std::map<SubmapKey, std::pair<int, int>> looked_at_and_accepted;
  for (const BowProposal& proposal :
       bow_->Query({session, keyframe, Cursors(), options_.max_proposals, same_submap})) {
    const SubmapKey other{proposal.session, proposal.submap};
    const auto other_session = sessions_.find(other.session);
    if (other_session == sessions_.end() || !other_session->second.submaps.contains(other.submap) ||
        !other_session->second.submaps.at(other.submap).keyframes.contains(proposal.keyframe)) {
      continue;
    }
    auto& [looked_at, accepted] = looked_at_and_accepted[other];
    if (looked_at >= options_.max_verified_per_submap || accepted >= options_.max_accepted_per_submap) continue;
    ++looked_at;
    if (other == query) {
      // Loop closure within the submap: once for the two keyframes, the older first.
      if (proposal.keyframe > keyframe) continue;
      Loop loop{query, VerifyConnectedFrames(View(query), proposal.keyframe, View(query), keyframe,
                                             options_.connected_frames)};
      if (!loop.frames.success) continue;
      ++accepted;
      loops_.push_back(std::move(loop));
      continue;
    }
    const bool query_is_b = IsOlder(other, query);
    const PairKey pair = query_is_b ? PairKey(other, query) : PairKey(query, other);
    Connection& connection = connections_[pair];
    connection.a = pair.first;
    connection.b = pair.second;
    if (static_cast<int>(connection.evidence.size()) >= options_.max_evidence) continue;
    const KeyframeId keyframe_a = query_is_b ? proposal.keyframe : keyframe;
    const KeyframeId keyframe_b = query_is_b ? keyframe : proposal.keyframe;
    const bool known = std::any_of(connection.evidence.begin(), connection.evidence.end(), [&](const ConnectedFrames& e) {
      return e.keyframe_a == keyframe_a && e.keyframe_b == keyframe_b;
    });
    if (known) {
      ++accepted;
      continue;
    }
    ConnectedFrames frames =
        VerifyConnectedFrames(View(pair.first), keyframe_a, View(pair.second), keyframe_b, options_.connected_frames);
    ++connection.num_candidates;
    evaluated->insert(pair);
    if (frames.success) {
      ++accepted;
      connected_.insert({session, keyframe});
      connected_.insert({other.session, proposal.keyframe});
      connection.evidence.push_back(std::move(frames));
      dirty_.insert(pair);
    } else if (connection.best_failure.reason.empty() ||
               std::tuple(frames.num_inliers, frames.num_ransac_inliers, frames.num_matches) >
                   std::tuple(connection.best_failure.num_inliers, connection.best_failure.num_ransac_inliers,
                              connection.best_failure.num_matches)) {
      connection.best_failure = std::move(frames);
    }
  }
  output_->OnProgress("looking for connections");
}

void Merger::Update(const std::set<PairKey>& evaluated, bool announce_all) {
  const std::vector<SubmapKey> keys = OrderedSubmaps();
  std::map<SubmapKey, int> index;
  for (size_t i = 0; i < keys.size(); ++i) index[keys[i]] = static_cast<int>(i);

  std::map<PairKey, Connection> before;
  for (const auto& [pair, connection] : connections_) {
    Connection& b = before[pair];
    b.verdict = connection.verdict;
    b.in_tree = connection.in_tree;
  }
  std::vector<Connection*> active;
  std::vector<CycleEdge> edges;
  for (auto& [pair, connection] : connections_) {
    if (dirty_.contains(pair) || evaluated.contains(pair) || announce_all ||
        connection.verdict == Connection::Verdict::kDeactivated) {  // which is judged anew below
      EstimateConnection(View(pair.first), View(pair.second), options_.connection, &connection);
    }
    connection.in_tree = false;
    if (connection.verdict != Connection::Verdict::kAccepted) continue;
    if (disabled_.contains(pair)) {
      connection.verdict = Connection::Verdict::kDeactivated;
      connection.reason = "switched off by hand";
      continue;
    }
    const Submap& a = *View(pair.first).submap;
    edges.push_back({index.at(pair.first), index.at(pair.second), connection.strength, connection.b_from_a,
                     connection.information, Probes(connection, a), ViewingDistance(connection, a)});
    active.push_back(&connection);
  }
  dirty_.clear();

  const CycleConsistencyResult consistent =
      FindConsistentForest(static_cast<int>(keys.size()), edges, options_.cycles);
  std::vector<TreeEdge> tree;
  for (size_t i = 0; i < active.size(); ++i) {
    if (consistent.active[i]) continue;
    active[i]->verdict = Connection::Verdict::kDeactivated;
    active[i]->reason = consistent.reason[i];
  }
  for (const int e : consistent.forest.edges) {
    active[e]->in_tree = true;
    tree.push_back({edges[e].a, edges[e].b, edges[e].b_from_a});
  }
  const std::vector<MergedPlace> places = ComposeAlongForest(static_cast<int>(keys.size()), tree);

  // Components in order of the frames they hold.
  num_components_ = consistent.forest.num_components;
  std::vector<std::pair<long, int>> frames(num_components_);
  for (int c = 0; c < num_components_; ++c) frames[c].second = c;
  for (size_t i = 0; i < keys.size(); ++i) {
    frames[consistent.forest.component[i]].first -= static_cast<long>(View(keys[i]).submap->frames.size());
  }
  std::stable_sort(frames.begin(), frames.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<int> rank(num_components_);
  for (int r = 0; r < num_components_; ++r) rank[frames[r].second] = r;

  MergedTransforms transforms;
  transforms.revision = 2 * num_records_;
  transforms.cursors = Cursors();
  for (size_t i = 0; i < keys.size(); ++i) {
    transforms.submaps.push_back({keys[i], rank[consistent.forest.component[i]], places[i].root_from_vertex,
                                  places[i].root == static_cast<int>(i)});
  }
  for (const TreeEdge& e : tree) transforms.edges.push_back({e.a, e.b});

  for (const auto& [pair, connection] : connections_) {
    const Connection& old = before.at(pair);
    if (announce_all || evaluated.contains(pair) || old.verdict != connection.verdict || old.in_tree != connection.in_tree) {
      output_->OnConnection(connection);
    }
  }
  const bool changed = !SamePlaces(transforms, transforms_);
  if (changed || announce_all) {
    transforms_ = std::move(transforms);
    output_->OnTransforms(transforms_);
  }
}

void Merger::SetDisabled(const std::set<std::pair<SubmapKey, SubmapKey>>& disabled) {
  disabled_ = disabled;
  if (!sessions_.empty()) Update({}, true);
}

void Merger::Finalize() {
  pending_.clear();
  connections_.clear();
  dirty_.clear();
  connected_.clear();
  loops_.clear();
  std::set<PairKey> evaluated;
  for (const SubmapKey& key : OrderedSubmaps()) {
    std::vector<KeyframeId> keyframes;
    for (const auto& [id, keyframe] : View(key).submap->keyframes) keyframes.push_back(id);
    for (const KeyframeId id : keyframes) Evaluate(key.session, key.submap, id, true, &evaluated);
  }
  Update(evaluated, true);
  Refine();
}

void Merger::Refine() {
  MergedTransforms refined = transforms_;
  refined.revision = 2 * num_records_ + 1;
  refined.refined = true;
  refined.is_final = AllEnded();
  std::vector<RefinedSubmap> parts;
  for (int component = 0; component < num_components_; ++component) {
    std::vector<int> members;  // indices into transforms_.submaps, oldest first
    std::map<SubmapKey, int> local;
    std::vector<SubmapView> views;
    std::vector<Similarity3> root_from_submap;
    for (size_t i = 0; i < refined.submaps.size(); ++i) {
      const MergedTransforms::Place& place = refined.submaps[i];
      if (place.component != component) continue;
      local[place.key] = static_cast<int>(members.size());
      members.push_back(static_cast<int>(i));
      views.push_back(View(place.key));
      root_from_submap.push_back(place.root_from_submap);
    }
    std::vector<RefinementLink> links;
    for (const auto& [pair, connection] : connections_) {
      if (connection.verdict != Connection::Verdict::kAccepted || !local.contains(pair.first)) continue;
      for (size_t i = 0; i < connection.evidence.size(); ++i) {
        const ConnectedFrames& e = connection.evidence[i];
        if (connection.agrees[i]) {
          links.push_back({local.at(pair.first), local.at(pair.second), e.keyframe_a, e.keyframe_b, e.b_from_a});
        }
      }
    }
    for (const Loop& loop : loops_) {
      if (!local.contains(loop.submap)) continue;
      const int s = local.at(loop.submap);
      links.push_back({s, s, loop.frames.keyframe_a, loop.frames.keyframe_b, loop.frames.b_from_a});
    }
    MergedRefinementResult result = RefineMergedMap(views, root_from_submap, links, options_.refinement,
                                                    [&](const std::string& what) { output_->OnProgress(what); });
    output_->OnProgress("refinement: " + result.summary.reason);

    std::vector<RefinedSubmap> component_parts(members.size());
    for (size_t s = 0; s < members.size(); ++s) {
      MergedTransforms::Place& place = refined.submaps[members[s]];
      place.root_from_submap = result.root_from_submap[s];
      component_parts[s].key = place.key;
    }
    for (const MergedKeyframe& k : result.map.keyframes) {
      component_parts[k.submap].keyframes.push_back({k.keyframe->id, k.cam_from_root, k.scale});
    }
    for (const MergedPoint& p : result.map.points) {
      if (p.track.empty()) continue;
      const auto& [first_submap, first_id] = p.members.front();
      component_parts[first_submap].points.push_back({first_id, p.position.cast<float>()});
      for (size_t m = 1; m < p.members.size(); ++m) {
        component_parts[p.members[m].first].fused.push_back(
            {p.members[m].second, component_parts[first_submap].key, first_id});
      }
    }
    parts.insert(parts.end(), component_parts.begin(), component_parts.end());
  }
  std::vector<Connection> connections;
  for (const auto& [pair, connection] : connections_) connections.push_back(connection);
  transforms_ = refined;
  output_->OnRevision(refined, connections, parts);
}

}  // namespace mapmend

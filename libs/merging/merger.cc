#include "libs/merging/merger.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "libs/merging/flight_seed.h"

namespace mapmend {
namespace {

bool SamePlaces(const MergedTransforms& l, const MergedTransforms& r) {
  if (l.submaps.size() != r.submaps.size() || l.edges != r.edges) return false;
  for (size_t i = 0; i < l.submaps.size(); ++i) {
    if (l.submaps[i].key != r.submaps[i].key || l.submaps[i].component != r.submaps[i].component ||
        ToArray(l.submaps[i].root_from_submap) != ToArray(r.submaps[i].root_from_submap)) {
      return false;
    }
  }
  return true;
}

std::pair<SubmapKey, SubmapKey> Sorted(const SubmapKey& a, const SubmapKey& b) {
  return a < b ? std::pair(a, b) : std::pair(b, a);
}

// The failure that came nearest to success tells best why there is no connection.
bool IsBetterFailure(const ConnectedFrames& frames, const ConnectedFrames& best) {
  return best.reason.empty() || std::tuple(frames.num_inliers, frames.num_ransac_inliers, frames.num_matches) >
                                    std::tuple(best.num_inliers, best.num_ransac_inliers, best.num_matches);
}

}  // namespace

MergerOptions::MergerOptions() {
  live_refinement.radii = {16, 8};
  live_refinement.iterations = {5, 8};
  live_refinement.max_keyframes_with_all_points = 0;
  live_refinement.max_keyframes_at_once = 600;
  live_refinement.windows.max_windows = 4;
  live_refinement.find_readouts = false;
}

std::string MergerOptions::Check() const {
  if (const std::string e = connected_frames.Check(); !e.empty()) return "connected_frames: " + e;
  if (const std::string e = loops.Check(); !e.empty()) return "loops: " + e;
  if (const std::string e = cycles.Check(); !e.empty()) return "cycles: " + e;
  if (const std::string e = refinement.Check(); !e.empty()) return "refinement: " + e;
  if (const std::string e = live_refinement.Check(); !e.empty()) return "live_refinement: " + e;
  if (max_cached_keyframes < connected_frames.max_window_size + connected_frames.window_size)
    return "the cache must hold the keyframes of two windows";
  if (max_proposals < 1 || max_verified_per_submap < 1 || max_accepted_per_submap < 1 || max_evidence < 1) {
    return "the limits must be positive";
  }
  return "";
}

Merger::Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output, KeyframeSource* keyframes)
    : options_(options),
      bow_(bow),
      output_(output),
      keyframes_(keyframes),
      cache_(keyframes ? options.max_cached_keyframes : std::numeric_limits<int>::max(), keyframes, &sessions_) {}

SubmapView Merger::View(const SubmapKey& key) const {
  const Session& session = sessions_.at(key.session);
  return {&session.submaps.at(key.submap), session.info.pinhole, session.info.pyramid, session.info.camera,
          key.session};
}

ConnectedFrames Merger::Verify(const SubmapKey& a, KeyframeId keyframe_a, const SubmapKey& b, KeyframeId keyframe_b) {
  const SubmapView view_a = View(a), view_b = View(b);
  const int usual = options_.connected_frames.window_size;
  const auto verify = [&](const WindowSizes& sizes) {
    cache_.Load(a, LocalWindow(*view_a.submap, keyframe_a, sizes.a));
    cache_.Load(b, LocalWindow(*view_b.submap, keyframe_b, sizes.b));
    return VerifyConnectedFrames(view_a, keyframe_a, view_b, keyframe_b, options_.connected_frames, sizes);
  };
  ConnectedFrames frames = verify({usual, usual});
  // Seen from very different heights a pair may need more of the nearer side's images to show what it shares.
  if (!frames.success && std::max(frames.wanted.a, frames.wanted.b) >= 2 * usual) frames = verify(frames.wanted);
  return frames;
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
  return !sessions_.empty() &&
         std::all_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s.second.ended; });
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
  ++state_;
  if (std::holds_alternative<SessionStarted>(record.body)) {
    options_.connected_frames.ransac.seed = options_.seed.value_or(SeedOfFlights(sessions_).value_or(1));
  }
  complete_ = false;
  std::set<PairKey> evaluated;
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    cache_.Add({id, keyframe->submap}, keyframe->keyframe);
    pending_[id].push_back({keyframe->submap, keyframe->keyframe});
  } else if (std::holds_alternative<MapUpdate>(record.body)) {
    if (!pending_[id].empty()) {
      evaluated.swap(evaluated_again_);
      EvaluatePending(id, &evaluated);
      Update(evaluated, false);
      EvaluateAgain(&evaluated_again_);
    }
  } else if (const auto* end = std::get_if<SubmapEnded>(&record.body)) {
    EvaluatePending(id, &evaluated);
    AskAgainLater({id, end->submap});
    session.submaps.at(end->submap).ForgetObservations();
    // The submap will not change any more: its connections are estimated from where its points have come to lie.
    for (const auto& [pair, connection] : connections_) {
      const SubmapKey ended{id, end->submap};
      if (pair.first == ended || pair.second == ended) dirty_.insert(pair);
    }
    Update(evaluated, false);
  }
  return "";
}

void Merger::EvaluatePending(const std::string& session, std::set<PairKey>* evaluated) {
  std::vector<Pending> pending;
  pending.swap(pending_[session]);
  for (const Pending& p : pending) Evaluate(session, p.submap, p.keyframe, Among::kOthers, evaluated);
}

void Merger::AskAgainLater(const SubmapKey& submap) {
  const std::vector<SubmapKey> keys = OrderedSubmaps();
  if (std::none_of(keys.begin(), keys.end(),
                   [&](const SubmapKey& key) { return key != submap && View(key).submap->ended; })) {
    return;
  }
  std::vector<KeyframeId> open;
  for (const auto& [id, keyframe] : View(submap).submap->keyframes) {
    if (!connected_.contains({submap.session, id})) open.push_back(id);
  }
  const size_t n = std::min(open.size(), static_cast<size_t>(options_.max_evaluated_again));
  for (size_t i = 0; i < n; ++i) again_.push_back({submap, open[i * open.size() / n]});
}

void Merger::EvaluateAgain(std::set<PairKey>* evaluated) {
  while (!again_.empty()) {
    const auto [submap, keyframe] = again_.front();
    again_.pop_front();
    if (connected_.contains({submap.session, keyframe})) continue;  // meanwhile
    Evaluate(submap.session, submap.submap, keyframe, Among::kEndedOthers, evaluated);
    return;
  }
}

void Merger::Evaluate(const std::string& session, SubmapId submap, KeyframeId keyframe, Among among,
                      std::set<PairKey>* evaluated) {
  if (!sessions_.at(session).submaps.at(submap).keyframes.contains(keyframe)) return;  // culled before its turn
  const SubmapKey query{session, submap};
  std::map<SubmapKey, std::pair<int, int>> looked_at_and_accepted;
  const BowQuestion question{session, keyframe, Cursors(), options_.max_proposals, among == Among::kAll};
  for (const BowProposal& proposal : bow_->Query(question)) {
    const SubmapKey other{proposal.session, proposal.submap};
    const auto other_session = sessions_.find(other.session);
    if (other_session == sessions_.end() || !other_session->second.submaps.contains(other.submap) ||
        !other_session->second.submaps.at(other.submap).keyframes.contains(proposal.keyframe)) {
      continue;
    }
    if (among == Among::kEndedOthers && !other_session->second.submaps.at(other.submap).ended) continue;
    // Loop closure within the submap: once for the two keyframes, the older first.
    if (other == query && proposal.keyframe > keyframe) continue;
    auto& [looked_at, accepted] = looked_at_and_accepted[other];
    if (looked_at >= options_.max_verified_per_submap || accepted >= options_.max_accepted_per_submap) continue;
    ++looked_at;
    accepted += other == query ? EvaluateLoop(query, proposal.keyframe, keyframe)
                               : EvaluatePair(query, keyframe, other, proposal.keyframe, evaluated);
  }
  for (const auto& [other, neighbors] : NeighborsInTime(sessions_.at(session), submap, keyframe, options_.neighbors)) {
    int& accepted = looked_at_and_accepted[{session, other}].second;
    for (const KeyframeId neighbor : neighbors) {
      if (accepted >= options_.max_accepted_per_submap) break;
      accepted += EvaluatePair(query, keyframe, {session, other}, neighbor, evaluated);
    }
  }
  output_->OnProgress("looking for connections");
}

bool Merger::EvaluatePair(const SubmapKey& query, KeyframeId keyframe, const SubmapKey& other, KeyframeId proposed,
                          std::set<PairKey>* evaluated) {
  const bool query_is_b = IsOlder(other, query);
  const PairKey pair = query_is_b ? PairKey(other, query) : PairKey(query, other);
  Connection& connection = connections_[pair];
  connection.a = pair.first;
  connection.b = pair.second;
  if (static_cast<int>(connection.evidence.size()) >= options_.max_evidence) return false;
  const KeyframeId keyframe_a = query_is_b ? proposed : keyframe;
  const KeyframeId keyframe_b = query_is_b ? keyframe : proposed;
  const bool known = std::any_of(connection.evidence.begin(), connection.evidence.end(), [&](const ConnectedFrames& e) {
    return e.keyframe_a == keyframe_a && e.keyframe_b == keyframe_b;
  });
  if (known) return true;
  ConnectedFrames frames = Verify(pair.first, keyframe_a, pair.second, keyframe_b);
  ++connection.num_candidates;
  evaluated->insert(pair);
  if (frames.success) {
    connected_.insert({query.session, keyframe});
    connected_.insert({other.session, proposed});
    connection.evidence.push_back(std::move(frames));
    dirty_.insert(pair);
    return true;
  }
  if (IsBetterFailure(frames, connection.best_failure)) connection.best_failure = std::move(frames);
  return false;
}

bool Merger::EvaluateLoop(const SubmapKey& submap, KeyframeId keyframe_a, KeyframeId keyframe_b) {
  Connection& loops = loops_[submap];
  loops.a = loops.b = submap;
  ++loops.num_candidates;
  ConnectedFrames frames = Verify(submap, keyframe_a, submap, keyframe_b);
  if (frames.success) {
    loops.evidence.push_back(std::move(frames));
    return true;
  }
  if (IsBetterFailure(frames, loops.best_failure)) loops.best_failure = std::move(frames);
  return false;
}

void Merger::Update(const std::set<PairKey>& evaluated, bool announce_all) {
  std::map<PairKey, std::pair<Connection::Verdict, bool>> before;
  for (const auto& [pair, connection] : connections_) before[pair] = {connection.verdict, connection.in_tree};
  JudgeConnections(evaluated, announce_all);
  for (const PairKey& pair : live_.pairs) {
    const auto it = connections_.find(pair);
    if (it != connections_.end() && it->second.verdict == Connection::Verdict::kAccepted) continue;
    live_ = {};  // a connection that has turned out wrong bent what was refined with it
    break;
  }
  for (const auto& [pair, connection] : connections_) {
    if (announce_all || evaluated.contains(pair) ||
        before.at(pair) != std::pair(connection.verdict, connection.in_tree)) {
      output_->OnConnection(connection);
    }
  }
  if (announce_all) {
    for (const auto& [key, loops] : loops_) output_->OnConnection(loops);
  }
  MergedTransforms transforms = PlaceSubmaps();
  if (announce_all || !SamePlaces(transforms, transforms_)) {
    transforms_ = std::move(transforms);
    output_->OnTransforms(transforms_);
  }
}

void Merger::JudgeConnections(const std::set<PairKey>& evaluated, bool estimate_all) {
  const std::vector<SubmapKey> keys = OrderedSubmaps();
  std::map<SubmapKey, int> index;
  for (size_t i = 0; i < keys.size(); ++i) index[keys[i]] = static_cast<int>(i);
  std::vector<Connection*> active;
  std::vector<CycleEdge> edges;
  for (auto& [pair, connection] : connections_) {
    if (dirty_.contains(pair) || evaluated.contains(pair) || estimate_all ||
        connection.verdict == Connection::Verdict::kDeactivated) {  // which is judged anew below
      EstimateConnection(View(pair.first), View(pair.second), options_.connection, &connection);
    }
    connection.in_tree = false;
    if (connection.verdict != Connection::Verdict::kAccepted) continue;
    if (IsDisabled(pair)) {
      connection.verdict = Connection::Verdict::kDeactivated;
      connection.reason = "switched off by hand; would be used: " + connection.reason;
      continue;
    }
    edges.push_back({index.at(pair.first), index.at(pair.second), connection.strength, connection.b_from_a,
                     connection.information, connection.probes, connection.viewing_distance});
    active.push_back(&connection);
  }
  dirty_.clear();

  const auto credit = [&](int e) {
    return RecognizedShare(View(active[e]->a), View(active[e]->b), *active[e], options_.max_evidence,
                           options_.recognized);
  };
  CycleConsistencyResult consistent =
      FindConsistentForest(static_cast<int>(keys.size()), edges, options_.cycles, credit);
  for (size_t i = 0; i < active.size(); ++i) {
    if (consistent.active[i]) continue;
    active[i]->verdict = Connection::Verdict::kDeactivated;
    active[i]->reason = consistent.reason[i];
  }
  tree_.clear();
  for (const int e : consistent.forest.edges) {
    active[e]->in_tree = true;
    tree_.push_back({edges[e].a, edges[e].b, edges[e].b_from_a});
  }
  forest_ = std::move(consistent.forest);
}

MergedTransforms Merger::PlaceSubmaps() const {
  const std::vector<SubmapKey> keys = OrderedSubmaps();
  std::vector<RefinedPlace> refined(keys.size());
  for (size_t i = 0; i < keys.size(); ++i) {
    const auto it = live_.places.find(keys[i]);
    if (it != live_.places.end() && !complete_) refined[i] = it->second;
  }
  const std::vector<MergedPlace> places = ComposeAlongForest(static_cast<int>(keys.size()), tree_, refined);

  // Components in order of the frames they hold. A submap that began after the last update is one of its own.
  std::vector<int> component(forest_.component);
  int num_components = forest_.num_components;
  while (component.size() < keys.size()) component.push_back(num_components++);
  std::vector<std::pair<long, int>> frames(num_components);
  for (int c = 0; c < num_components; ++c) frames[c].second = c;
  for (size_t i = 0; i < keys.size(); ++i) {
    frames[component[i]].first -= static_cast<long>(View(keys[i]).submap->frames.size());
  }
  std::stable_sort(frames.begin(), frames.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  std::vector<int> rank(num_components);
  for (int r = 0; r < num_components; ++r) rank[frames[r].second] = r;

  MergedTransforms transforms;
  transforms.revision = 2 * (num_records_ + num_decisions_);
  transforms.cursors = Cursors();
  for (size_t i = 0; i < keys.size(); ++i) {
    transforms.submaps.push_back(
        {keys[i], rank[component[i]], places[i].root_from_vertex, places[i].root == static_cast<int>(i)});
  }
  for (const TreeEdge& e : tree_) transforms.edges.push_back({e.a, e.b});
  return transforms;
}

bool Merger::IsDisabled(const PairKey& pair) const { return disabled_.contains(Sorted(pair.first, pair.second)); }

void Merger::SetDecisions(const std::vector<EdgeDecision>& decisions) {
  if (static_cast<int>(decisions.size()) == num_decisions_) return;
  num_decisions_ = static_cast<int>(decisions.size());
  ++state_;
  disabled_.clear();
  for (const EdgeDecision& d : decisions) {
    if (d.disabled) {
      disabled_.insert(Sorted(d.a, d.b));
    } else {
      disabled_.erase(Sorted(d.a, d.b));
    }
  }
  if (!sessions_.empty()) Update({}, true);
}

void Merger::Complete() {
  pending_.clear();
  again_.clear();
  evaluated_again_.clear();
  connections_.clear();
  dirty_.clear();
  connected_.clear();
  loops_.clear();
  live_ = {};
  ++state_;
  std::set<PairKey> evaluated;
  for (const SubmapKey& key : OrderedSubmaps()) {
    std::vector<KeyframeId> keyframes;
    for (const auto& [id, keyframe] : View(key).submap->keyframes) keyframes.push_back(id);
    for (const KeyframeId id : keyframes) Evaluate(key.session, key.submap, id, Among::kAll, &evaluated);
  }
  for (auto& [key, loops] : loops_) {
    const auto verify = [&, submap = key](KeyframeId a, KeyframeId b) { return Verify(submap, a, submap, b); };
    SeekSupport(View(key), options_.loops, verify, &loops);
    EstimateLoops(View(key), options_.loops, &loops);
  }
  complete_ = true;
  Update(evaluated, true);
}

std::vector<Connection> Merger::connections() const {
  std::vector<Connection> all;
  for (const auto& [pair, connection] : connections_) all.push_back(connection);
  for (const auto& [key, loops] : loops_) all.push_back(loops);
  return all;
}

}  // namespace mapmend

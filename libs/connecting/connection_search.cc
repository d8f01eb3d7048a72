#include "libs/connecting/connection_search.h"

#include <algorithm>
#include <limits>

#include "libs/base/options.h"

namespace mapmend {

std::string ConnectionSearchOptions::Check() const { return CheckOptions(*this); }

std::string ConnectionSearchOptions::Conflict() const {
  const int needed = connected_frames.max_window_size + connected_frames.window_size;
  if (max_cached_keyframes >= needed) return "";
  return "max_cached_keyframes must be at least " + std::to_string(needed) +
         ", the keyframes of two windows (connected_frames.max_window_size and window_size)";
}

ConnectionSearch::ConnectionSearch(const ConnectionSearchOptions& options, Sessions* sessions, BowSource* bow,
                                   KeyframeSource* keyframes, std::function<void()> progress)
    : options_(options),
      sessions_(sessions),
      bow_(bow),
      progress_(std::move(progress)),
      cache_(keyframes ? options.max_cached_keyframes : std::numeric_limits<int>::max(), keyframes, sessions) {}

void ConnectionSearch::OnKeyframe(const SubmapKey& submap, KeyframeId keyframe) {
  cache_.Add(submap, keyframe);
  waiting_.for_points[submap.session].push_back({submap, keyframe});
}

std::optional<std::set<SubmapPair>> ConnectionSearch::OnMapUpdate(const std::string& session, ConnectionGraph* graph) {
  if (waiting_.for_points[session].empty()) return std::nullopt;
  std::set<SubmapPair> looked_at;
  looked_at.swap(waiting_.looked_at_again);
  looked_at.merge(AskWaiting(session, graph));
  return looked_at;
}

std::set<SubmapPair> ConnectionSearch::OnSubmapEnd(const SubmapKey& submap, ConnectionGraph* graph) {
  std::set<SubmapPair> looked_at = AskWaiting(submap.session, graph);
  const std::vector<SubmapKey> keys = SubmapsByAge(*sessions_);
  const bool others_have_ended = std::any_of(keys.begin(), keys.end(), [&](const SubmapKey& key) {
    return key != submap && ViewSubmap(*sessions_, key).submap->ended;
  });
  if (!others_have_ended) return looked_at;
  std::vector<KeyframeId> open;
  for (const auto& [id, keyframe] : ViewSubmap(*sessions_, submap).submap->keyframes) {
    if (!waiting_.connected.contains({submap.session, id})) open.push_back(id);
  }
  const size_t n = std::min(open.size(), static_cast<size_t>(options_.max_evaluated_again));
  for (size_t i = 0; i < n; ++i) waiting_.again.push_back({submap, open[i * open.size() / n]});
  return looked_at;
}

void ConnectionSearch::AskAgain(ConnectionGraph* graph) {
  while (!waiting_.again.empty()) {
    const auto [submap, keyframe] = waiting_.again.front();
    waiting_.again.pop_front();
    if (waiting_.connected.contains({submap.session, keyframe})) continue;  // meanwhile
    Ask(submap, keyframe, Among::kEndedOthers, graph, &waiting_.looked_at_again);
    return;
  }
}

std::set<SubmapPair> ConnectionSearch::SearchAll(ConnectionGraph* graph) {
  waiting_ = {};
  std::set<SubmapPair> looked_at;
  for (const SubmapKey& key : SubmapsByAge(*sessions_)) {
    std::vector<KeyframeId> keyframes;
    for (const auto& [id, keyframe] : ViewSubmap(*sessions_, key).submap->keyframes) keyframes.push_back(id);
    for (const KeyframeId id : keyframes) Ask(key, id, Among::kAll, graph, &looked_at);
  }
  graph->JudgeLoops(
      *sessions_, [this](const SubmapKey& submap, KeyframeId a, KeyframeId b) { return Verify(submap, a, submap, b); });
  return looked_at;
}

std::set<SubmapPair> ConnectionSearch::AskWaiting(const std::string& session, ConnectionGraph* graph) {
  std::vector<Asked> waiting;
  waiting.swap(waiting_.for_points[session]);
  std::set<SubmapPair> looked_at;
  for (const auto& [submap, keyframe] : waiting) Ask(submap, keyframe, Among::kOthers, graph, &looked_at);
  return looked_at;
}

bool ConnectionSearch::HasKeyframe(const SubmapKey& submap, KeyframeId keyframe) const {
  const auto session = sessions_->find(submap.session);
  return session != sessions_->end() && session->second.submaps.contains(submap.submap) &&
         session->second.submaps.at(submap.submap).keyframes.contains(keyframe);
}

void ConnectionSearch::Ask(const SubmapKey& submap, KeyframeId keyframe, Among among, ConnectionGraph* graph,
                           std::set<SubmapPair>* looked_at) {
  if (!HasKeyframe(submap, keyframe)) return;  // culled before its turn
  const Asked query{submap, keyframe};
  std::map<SubmapKey, Tally> tally;
  AskRetrieval(query, among, graph, looked_at, &tally);
  const Session& session = sessions_->at(submap.session);
  for (const auto& [other, neighbors] : NeighborsInTime(session, submap.submap, keyframe, options_.neighbors)) {
    const SubmapKey key{submap.session, other};
    int& accepted = tally[key].accepted;
    for (const KeyframeId neighbor : neighbors) {
      if (accepted >= options_.max_accepted_per_submap) break;
      accepted += VerifyPair(query, {key, neighbor}, graph, looked_at);
    }
  }
  progress_();
}

void ConnectionSearch::AskRetrieval(const Asked& query, Among among, ConnectionGraph* graph,
                                    std::set<SubmapPair>* looked_at, std::map<SubmapKey, Tally>* tally) {
  const auto& [submap, keyframe] = query;
  const BowQuestion question{submap.session, keyframe, CursorsOf(*sessions_), options_.max_proposals,
                             among == Among::kAll};
  for (const BowProposal& proposal : bow_->Query(question)) {
    const SubmapKey other{proposal.session, proposal.submap};
    if (!HasKeyframe(other, proposal.keyframe)) continue;
    if (among == Among::kEndedOthers && !ViewSubmap(*sessions_, other).submap->ended) continue;
    // Loop closure within the submap: once for the two keyframes, the older first.
    if (other == submap && proposal.keyframe > keyframe) continue;
    Tally& t = (*tally)[other];
    if (t.looked_at >= options_.max_verified_per_submap || t.accepted >= options_.max_accepted_per_submap) continue;
    ++t.looked_at;
    t.accepted += other == submap ? VerifyLoop(submap, proposal.keyframe, keyframe, graph)
                                  : VerifyPair(query, {other, proposal.keyframe}, graph, looked_at);
  }
}

bool ConnectionSearch::VerifyPair(const Asked& query, const Asked& other, ConnectionGraph* graph,
                                  std::set<SubmapPair>* looked_at) {
  const SubmapPair pair = MakePair(*sessions_, query.first, other.first);
  const bool query_is_older = pair.older == query.first;
  const KeyframeId older = query_is_older ? query.second : other.second;
  const KeyframeId younger = query_is_older ? other.second : query.second;
  if (graph->IsFull(pair)) return false;
  if (graph->Knows(pair, older, younger)) return true;
  ConnectedFrames frames = Verify(pair.older, older, pair.younger, younger);
  const bool holds = frames.success;
  if (holds) {
    waiting_.connected.insert({query.first.session, query.second});
    waiting_.connected.insert({other.first.session, other.second});
  }
  graph->Add(pair, std::move(frames));
  looked_at->insert(pair);
  return holds;
}

bool ConnectionSearch::VerifyLoop(const SubmapKey& submap, KeyframeId a, KeyframeId b, ConnectionGraph* graph) {
  ConnectedFrames frames = Verify(submap, a, submap, b);
  const bool holds = frames.success;
  graph->AddLoop(submap, std::move(frames));
  return holds;
}

ConnectedFrames ConnectionSearch::Verify(const SubmapKey& a, KeyframeId keyframe_a, const SubmapKey& b,
                                         KeyframeId keyframe_b) {
  const SubmapView view_a = ViewSubmap(*sessions_, a), view_b = ViewSubmap(*sessions_, b);
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

}  // namespace mapmend

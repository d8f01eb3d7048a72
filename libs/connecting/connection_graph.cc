#include "libs/connecting/connection_graph.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "libs/base/options.h"

namespace mapmend {
namespace {

// The failure that came nearest to success tells best why there is no connection.
bool IsBetterFailure(const ConnectedFrames& frames, const ConnectedFrames& best) {
  return best.reason.empty() || std::tuple(frames.num_inliers, frames.num_ransac_inliers, frames.num_matches) >
                                    std::tuple(best.num_inliers, best.num_ransac_inliers, best.num_matches);
}

// True if the pair holds.
bool AddTo(Connection* connection, ConnectedFrames frames) {
  ++connection->num_candidates;
  if (frames.success) {
    connection->evidence.push_back(std::move(frames));
    return true;
  }
  if (IsBetterFailure(frames, connection->best_failure)) connection->best_failure = std::move(frames);
  return false;
}

std::pair<SubmapKey, SubmapKey> Sorted(const SubmapKey& a, const SubmapKey& b) {
  return a < b ? std::pair(a, b) : std::pair(b, a);
}

}  // namespace

std::string ConnectionGraphOptions::Check() const { return CheckOptions(*this); }

void ConnectionGraph::Add(const SubmapPair& pair, ConnectedFrames frames) {
  Connection& connection = connections_[pair];
  connection.a = pair.older;
  connection.b = pair.younger;
  if (AddTo(&connection, std::move(frames))) changed_.insert(pair);
}

void ConnectionGraph::AddLoop(const SubmapKey& submap, ConnectedFrames frames) {
  Connection& loops = loops_[submap];
  loops.a = loops.b = submap;
  AddTo(&loops, std::move(frames));
}

bool ConnectionGraph::IsFull(const SubmapPair& pair) const {
  const auto it = connections_.find(pair);
  return it != connections_.end() && static_cast<int>(it->second.evidence.size()) >= options_.max_evidence;
}

bool ConnectionGraph::Knows(const SubmapPair& pair, KeyframeId older, KeyframeId younger) const {
  const auto it = connections_.find(pair);
  if (it == connections_.end()) return false;
  const std::vector<ConnectedFrames>& evidence = it->second.evidence;
  return std::any_of(evidence.begin(), evidence.end(),
                     [&](const ConnectedFrames& e) { return e.keyframe_a == older && e.keyframe_b == younger; });
}

void ConnectionGraph::Reestimate(const SubmapKey& submap) {
  for (const auto& [pair, connection] : connections_) {
    if (pair.older == submap || pair.younger == submap) changed_.insert(pair);
  }
}

void ConnectionGraph::SetDecisions(const std::vector<EdgeDecision>& decisions) {
  num_decisions_ = static_cast<int>(decisions.size());
  disabled_.clear();
  for (const EdgeDecision& d : decisions) {
    if (d.disabled) {
      disabled_.insert(Sorted(d.a, d.b));
    } else {
      disabled_.erase(Sorted(d.a, d.b));
    }
  }
}

ConnectionGraph ConnectionGraph::WithoutConnections() const {
  ConnectionGraph graph(options_);
  graph.disabled_ = disabled_;
  graph.num_decisions_ = num_decisions_;
  return graph;
}

bool ConnectionGraph::IsDisabled(const SubmapPair& pair) const {
  return disabled_.contains(Sorted(pair.older, pair.younger));
}

ConnectionGraph::ActiveEdges ConnectionGraph::Estimate(const Sessions& sessions, const std::set<SubmapPair>& looked_at,
                                                       bool all) {
  const std::vector<SubmapKey> keys = SubmapsByAge(sessions);
  std::map<SubmapKey, int> index;
  for (size_t i = 0; i < keys.size(); ++i) index[keys[i]] = static_cast<int>(i);
  ActiveEdges active;
  for (auto& [pair, connection] : connections_) {
    // One that cycles spoke against is judged anew each time.
    if (all || changed_.contains(pair) || looked_at.contains(pair) ||
        connection.verdict == Connection::Verdict::kDeactivated) {
      EstimateConnection(ViewSubmap(sessions, pair.older), ViewSubmap(sessions, pair.younger), options_.connection,
                         &connection);
    }
    connection.in_tree = false;
    if (connection.verdict != Connection::Verdict::kAccepted) continue;
    if (IsDisabled(pair)) {
      connection.verdict = Connection::Verdict::kDeactivated;
      connection.reason = ReasonPrefix(connection.kind) + ("switched off by hand; would be used: " + connection.reason);
      continue;
    }
    active.edges.push_back({index.at(pair.older), index.at(pair.younger), connection.strength, connection.b_from_a,
                            connection.information, connection.probes, connection.viewing_distance});
    active.connections.push_back(&connection);
  }
  changed_.clear();
  return active;
}

std::vector<const Connection*> ConnectionGraph::Solve(const Sessions& sessions, const std::set<SubmapPair>& looked_at,
                                                      bool all) {
  std::map<SubmapPair, std::pair<Connection::Verdict, bool>> before;
  for (const auto& [pair, connection] : connections_) before[pair] = {connection.verdict, connection.in_tree};
  ActiveEdges active = Estimate(sessions, looked_at, all);
  const auto credit = [&](int e) {
    const Connection& c = *active.connections[e];
    return RecognizedShare(ViewSubmap(sessions, c.a), ViewSubmap(sessions, c.b), c, options_.max_evidence,
                           options_.recognized);
  };
  const int num_submaps = static_cast<int>(SubmapsByAge(sessions).size());
  CycleConsistencyResult consistent = FindConsistentForest(num_submaps, active.edges, options_.cycles, credit);
  for (size_t i = 0; i < active.connections.size(); ++i) {
    if (consistent.active[i]) continue;
    active.connections[i]->verdict = Connection::Verdict::kDeactivated;
    active.connections[i]->reason = ReasonPrefix(active.connections[i]->kind) + consistent.reason[i];
  }
  tree_.clear();
  for (const int e : consistent.forest.edges) {
    active.connections[e]->in_tree = true;
    tree_.push_back({active.edges[e].a, active.edges[e].b, active.edges[e].b_from_a});
  }
  forest_ = std::move(consistent.forest);

  std::vector<const Connection*> news;
  for (const auto& [pair, connection] : connections_) {
    if (all || looked_at.contains(pair) || before.at(pair) != std::pair(connection.verdict, connection.in_tree))
      news.push_back(&connection);
  }
  return news;
}

void ConnectionGraph::JudgeLoops(
    const Sessions& sessions, const std::function<ConnectedFrames(const SubmapKey&, KeyframeId, KeyframeId)>& verify) {
  for (auto& [key, loops] : loops_) {
    const SubmapView view = ViewSubmap(sessions, key);
    SeekSupport(
        view, options_.loops, [&, submap = key](KeyframeId a, KeyframeId b) { return verify(submap, a, b); }, &loops);
    EstimateLoops(view, options_.loops, &loops);
  }
}

std::set<SubmapPair> ConnectionGraph::TreePairs() const {
  std::set<SubmapPair> pairs;
  for (const auto& [pair, connection] : connections_) {
    if (connection.in_tree) pairs.insert(pair);
  }
  return pairs;
}

bool ConnectionGraph::IsAccepted(const SubmapPair& pair) const {
  const auto it = connections_.find(pair);
  return it != connections_.end() && it->second.verdict == Connection::Verdict::kAccepted;
}

int ConnectionGraph::num_accepted() const {
  return static_cast<int>(std::count_if(connections_.begin(), connections_.end(), [](const auto& c) {
    return c.second.verdict == Connection::Verdict::kAccepted;
  }));
}

}  // namespace mapmend

#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connection.h"
#include "libs/connecting/cycle_consistency.h"
#include "libs/connecting/loop_connection.h"
#include "libs/connecting/recognized_share.h"
#include "libs/connecting/submap_pair.h"

namespace mapmend {

struct ConnectionGraphOptions {
  ConnectionOptions connection;
  LoopClosureOptions loops;
  CycleConsistencyOptions cycles;
  RecognizedShareOptions recognized;
  int max_evidence = 200;  // per connection: more adds cost and no knowledge

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("connection", connection);
    v("loops", loops);
    v("cycles", cycles);
    v("recognized", recognized);
    v("max_evidence", max_evidence, Range(1, 1e6));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// The undirected graph of the paper's section 3.5. A node is a submap; an edge is a connection with its evidence, and
// its weight is the strength C of section 3.4. Solve() picks the strongest forest (Kruskal on -C) of the edges that
// neither a person nor a cycle of other edges speaks against. Loops, in which a submap meets itself, are kept beside
// the edges and never part of the forest.
class ConnectionGraph {
 public:
  explicit ConnectionGraph(const ConnectionGraphOptions& options) : options_(options) {}

  // What verifying a pair of keyframes of two submaps has given; frames.keyframe_a is the older submap's. A pair that
  // does not hold is remembered for the reason of a rejection. The order in which evidence is added decides which of
  // equally good pieces is named; it does not decide what holds.
  void Add(const SubmapPair& pair, ConnectedFrames frames);
  void AddLoop(const SubmapKey& submap, ConnectedFrames frames);
  // Whether the edge has all the evidence it may have.
  bool IsFull(const SubmapPair& pair) const;
  // Whether these two keyframes are known to be connected frames.
  bool Knows(const SubmapPair& pair, KeyframeId older, KeyframeId younger) const;
  // The submap has changed: its connections are estimated anew when the graph is solved next.
  void Reestimate(const SubmapKey& submap);
  // All decisions of people so far, in order; the last one on a pair counts.
  void SetDecisions(const std::vector<EdgeDecision>& decisions);
  // A graph with the same options and decisions, and nothing else: for a new pass over all keyframes.
  ConnectionGraph WithoutConnections() const;

  // Estimates what is new, in `looked_at`, or (if `all`) everything, and picks the forest. Returns the connections that
  // are to be told: those looked at, and those whose verdict or place in the tree has changed, by pair.
  std::vector<const Connection*> Solve(const Sessions& sessions, const std::set<SubmapPair>& looked_at, bool all);
  // Loops that no other confirms seek support; then all loops are judged. Once, when their submaps are complete.
  //   verify  two keyframes of a submap
  void JudgeLoops(const Sessions& sessions,
                  const std::function<ConnectedFrames(const SubmapKey&, KeyframeId, KeyframeId)>& verify);

  const std::map<SubmapPair, Connection>& connections() const { return connections_; }
  const std::map<SubmapKey, Connection>& loops() const { return loops_; }
  // Of the last Solve; vertices are indices into its SubmapsByAge.
  const std::vector<TreeEdge>& tree() const { return tree_; }
  const SpanningForest& forest() const { return forest_; }
  std::set<SubmapPair> TreePairs() const;
  bool IsAccepted(const SubmapPair& pair) const;
  int num_accepted() const;
  int num_decisions() const { return num_decisions_; }

 private:
  struct ActiveEdges {
    std::vector<Connection*> connections;
    std::vector<CycleEdge> edges;
  };
  ActiveEdges Estimate(const Sessions& sessions, const std::set<SubmapPair>& looked_at, bool all);
  bool IsDisabled(const SubmapPair& pair) const;

  ConnectionGraphOptions options_;
  std::map<SubmapPair, Connection> connections_;
  std::map<SubmapKey, Connection> loops_;
  std::set<SubmapPair> changed_;  // evidence or a submap, since they were estimated
  // Those that people have switched off, the lesser key first: a decision may come before its sessions.
  std::set<std::pair<SubmapKey, SubmapKey>> disabled_;
  int num_decisions_ = 0;
  std::vector<TreeEdge> tree_;
  SpanningForest forest_;
};

}  // namespace mapmend

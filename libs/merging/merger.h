#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connection_graph.h"
#include "libs/connecting/connection_search.h"
#include "libs/connecting/motion_bridge.h"
#include "libs/connecting/wide_search.h"
#include "libs/merging/refinement_schedule.h"
#include "libs/merging/refinement_task.h"
#include "libs/stream/revision.h"

namespace mapmend {

// What the merger tells the world. Calls come in a deterministic order.
class MergerOutput {
 public:
  virtual ~MergerOutput() = default;
  virtual void OnConnection(const Connection& connection) = 0;
  virtual void OnTransforms(const MergedTransforms& transforms) = 0;
  virtual void OnRevision(const MergedTransforms& transforms, const std::vector<Connection>& connections,
                          const std::vector<RefinedSubmap>& submaps) = 0;
  // During long work: a sign of life.
  virtual void OnProgress(const std::string& what) = 0;
};

struct MergerOptions {
  std::optional<uint64_t> seed;  // none: that of the flight (flight_seed.h), or 1 if the flight does not tell
  ConnectionSearchOptions search;
  ConnectionGraphOptions graph;
  RefinementScheduleOptions refinement;
  WideSearchOptions wide;
  MotionBridgeOptions motion;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("seed", seed);
    v("search", search);
    v("graph", graph);
    v("refinement", refinement);
    v("wide", wide);
    v("motion", motion);
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// The flow of the paper's section 3.6, without LCM: consumes the stream, lets the search look for connected frames, the
// graph choose the tree, and the refinement mend the merged map, and says where every submap lies. The final map is a
// pure function of the stream and of the decisions of people: the same records and decisions give the same bits,
// whatever was refined on the way.
class Merger {
 public:
  // keyframes: where to read what the cache does not hold; null: everything is held.
  Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output, KeyframeSource* keyframes = nullptr);
  Merger(const Merger&) = delete;  // the search knows where the sessions are
  Merger& operator=(const Merger&) = delete;

  // The next record of its session. Returns an empty string, or why the record was refused.
  std::string Consume(const Record& record);
  // All decisions of people so far, in order. What changes by them is announced at once.
  void SetDecisions(const std::vector<EdgeDecision>& decisions);

  // Every session seen has ended (and there is one).
  bool AllEnded() const;
  // The second pass, once all sessions have ended: a new graph, with the connections of all keyframes from scratch, all
  // submaps complete, also within a submap. Depends only on the sessions' content, not on what happened live.
  void Complete();

  // Whether the merged map would gain by a refinement: the final one after Complete; before it, when the tree of a
  // joined map has changed or the map has grown.
  bool RefinementIsDue() const;
  // The refinement that is due, to be run anywhere while the merger lives.
  RefinementTask MakeRefinement();
  // Takes in its result and announces the revision. False if the map has changed too much meanwhile: another one is due
  // then.
  bool TakeRefinement(const RefinementOutcome& outcome);

  // Complete, and the final refinement in this thread.
  void Finalize();

  const Sessions& sessions() const { return sessions_; }
  // Of pairs of submaps, then of submaps with themselves (loop closure).
  std::vector<Connection> connections() const;
  const ConnectionGraph& graph() const { return graph_; }
  const KeyframeCache& keyframe_cache() const { return search_.cache(); }
  const MergedTransforms& transforms() const { return transforms_; }
  // Rolling ones that the final refinement found, per session.
  const std::map<std::string, Shutter>& shutters() const { return refinement_.shutters(); }
  uint64_t seed() const { return search_.seed(); }
  int64_t revision() const { return transforms_.revision; }
  bool IsFinal() const { return transforms_.is_final; }

 private:
  // Where to read what the cache does not hold; null: everything is held.
  KeyframeSource* keyframes() const { return search_.cache().source(); }
  // Counts everything that can change the map: the number of a revision that is not refined.
  int64_t Number() const { return 2 * (num_records_ + graph_.num_decisions()); }
  MergedTransforms Places() const;
  // Solves the graph and announces what has changed, connections first.
  void Announce(const std::set<SubmapPair>& looked_at, bool all);

  const MergerOptions options_;
  MergerOutput* output_;
  Sessions sessions_;
  ConnectionSearch search_;
  WideSearch wide_search_;
  ConnectionGraph graph_;
  RefinementSchedule refinement_;
  int64_t num_records_ = 0;
  bool complete_ = false;
  MergedTransforms transforms_;
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/connecting/connection.h"
#include "libs/connecting/cycle_consistency.h"
#include "libs/connecting/keyframe_cache.h"
#include "libs/connecting/loop_connection.h"
#include "libs/connecting/neighbors_in_time.h"
#include "libs/connecting/recognized_share.h"
#include "libs/merging/merged_revision.h"
#include "libs/merging/merged_transforms.h"
#include "libs/merging/refinement_task.h"

namespace mapmend {

// Which keyframes may see what this one sees? (paper §3.3)
struct BowQuestion {
  std::string session;
  KeyframeId keyframe;
  std::vector<MergerCursor> cursors;  // answer as of exactly these records
  int max_results = 20;
  bool same_submap = false;
};
struct BowProposal {
  std::string session;
  SubmapId submap;
  KeyframeId keyframe;
  double group_score = 0;
};

// Where the merger asks for proposals: the store, over the bus; in tests, anything.
class BowSource {
 public:
  virtual ~BowSource() = default;
  // Best first. Throws std::runtime_error if there is no answer.
  virtual std::vector<BowProposal> Query(const BowQuestion& question) = 0;
};

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
  MergerOptions();

  std::optional<uint64_t> seed;  // none: that of the flight (flight_seed.h), or 1 if the flight does not tell
  ConnectedFramesOptions connected_frames;  // with that seed
  ConnectionOptions connection;
  LoopClosureOptions loops;
  CycleConsistencyOptions cycles;
  RecognizedShareOptions recognized;
  MergedRefinementOptions refinement;       // of the final map
  MergedRefinementOptions live_refinement;  // during the flight: fewer rounds, and a part of the points
  int max_proposals = 20;                   // asked of retrieval per keyframe
  int max_verified_per_submap = 3;          // of them looked at, per other submap, best first ...
  int max_accepted_per_submap = 1;          // ... until so many are accepted
  NeighborsInTimeOptions neighbors;         // looked at besides
  int max_evidence = 200;                   // per connection: more adds cost and no knowledge
  int max_evaluated_again = 30;  // keyframes of an ended submap without a connection that are asked once more
  double live_growth = 1.5;      // refined anew when so many times the keyframes are joined, or the tree is another one
  int max_cached_keyframes = 500;  // held complete; of the others the bulk is read again when needed (keyframe_cache.h)

  std::string Check() const;
};

// A person's word on a connection.
struct EdgeDecision {
  SubmapKey a, b;         // in either order
  bool disabled = false;  // true: not to be used
};

// The merger proper, without LCM: consumes the stream, connects submaps, broadcasts transforms, and refines the merged
// map (paper §3.6). The final map is a pure function of the stream and of the decisions of people: the same records and
// decisions give the same bits, whatever was refined on the way. A keyframe is evaluated when the map update that
// follows it has brought its map points; at the latest at the end of its submap.
class Merger {
 public:
  // keyframes: where to read what the cache does not hold; null: everything is held.
  Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output, KeyframeSource* keyframes = nullptr);

  // The next record of its session. Returns an empty string, or why the record was refused.
  std::string Consume(const Record& record);
  // All decisions of people so far, in order. What changes by them is announced at once.
  void SetDecisions(const std::vector<EdgeDecision>& decisions);

  // Every session seen has ended (and there is one).
  bool AllEnded() const;
  // The second pass, once all sessions have ended: connections of all keyframes from scratch, with all submaps
  // complete, also within a submap. Depends only on the sessions' content, not on what happened live.
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

  const std::map<std::string, Session>& sessions() const { return sessions_; }
  // Of pairs of submaps, then of submaps with themselves (loop closure).
  std::vector<Connection> connections() const;
  const KeyframeCache& keyframe_cache() const { return cache_; }
  const MergedTransforms& transforms() const { return transforms_; }
  // Of rolling shutters that the final refinement found, seconds per session.
  const std::map<std::string, double>& readouts() const { return readouts_; }
  uint64_t seed() const { return options_.connected_frames.ransac.seed; }
  int num_connections() const { return static_cast<int>(connections_.size()); }
  int num_decisions() const { return num_decisions_; }
  int num_accepted() const;
  int num_components() const { return forest_.num_components; }
  int64_t revision() const { return transforms_.revision; }
  bool IsFinal() const { return transforms_.is_final; }

 private:
  using PairKey = std::pair<SubmapKey, SubmapKey>;
  // What the last refinement during the flight said.
  struct LiveRefinement {
    std::map<SubmapKey, RefinedPlace> places;
    std::set<PairKey> pairs;  // connections that took part
    std::set<PairKey> tree;
    int num_keyframes = 0;  // of submaps that were joined to others
  };

  SubmapView View(const SubmapKey& key) const;
  // VerifyConnectedFrames with all the keyframes that it looks at complete.
  ConnectedFrames Verify(const SubmapKey& a, KeyframeId keyframe_a, const SubmapKey& b, KeyframeId keyframe_b);
  bool IsOlder(const SubmapKey& l, const SubmapKey& r) const;
  std::vector<SubmapKey> OrderedSubmaps() const;
  std::vector<MergerCursor> Cursors() const;
  bool IsDisabled(const PairKey& pair) const;
  std::set<PairKey> TreePairs() const;
  int NumJoinedKeyframes() const;

  // Asks for proposals among these submaps and verifies them; pairs of submaps looked at are added to evaluated.
  enum class Among { kOthers, kEndedOthers, kAll };
  void Evaluate(const std::string& session, SubmapId submap, KeyframeId keyframe, Among among,
                std::set<PairKey>* evaluated);
  // Verifies a pair of keyframes of two submaps, unless it is known; true if it holds.
  bool EvaluatePair(const SubmapKey& query, KeyframeId keyframe, const SubmapKey& other, KeyframeId proposed,
                    std::set<PairKey>* evaluated);
  // Verifies a loop within a submap; true if it holds.
  bool EvaluateLoop(const SubmapKey& submap, KeyframeId keyframe_a, KeyframeId keyframe_b);
  void EvaluatePending(const std::string& session, std::set<PairKey>* evaluated);
  // Keyframes of an ended submap that found no connection are asked once more about the others that have ended (those
  // that grow ask themselves), one with each keyframe that comes: all at once they would hold up those behind them.
  // What it finds is told with the next keyframe.
  void AskAgainLater(const SubmapKey& submap);
  void EvaluateAgain(std::set<PairKey>* evaluated);
  // Estimates what changed, runs Kruskal with the cycle check, announces connections and transforms.
  void Update(const std::set<PairKey>& evaluated, bool announce_all);
  // Verdicts, tree and components.
  void JudgeConnections(const std::set<PairKey>& evaluated, bool estimate_all);
  // Of the tree as it is.
  MergedTransforms PlaceSubmaps() const;

  MergerOptions options_;
  BowSource* bow_;
  MergerOutput* output_;
  KeyframeSource* keyframes_;
  std::map<std::string, Session> sessions_;
  KeyframeCache cache_;
  int64_t num_records_ = 0;
  int64_t state_ = 0;  // counts everything that can change the map
  struct Pending {
    SubmapId submap;
    KeyframeId keyframe;
  };
  std::map<std::string, std::vector<Pending>> pending_;
  std::deque<std::pair<SubmapKey, KeyframeId>> again_;
  std::set<PairKey> evaluated_again_;
  std::map<PairKey, Connection> connections_;
  std::set<PairKey> dirty_;                                 // edges whose evidence changed since they were estimated
  std::set<std::pair<std::string, KeyframeId>> connected_;  // keyframes with an accepted connected frame
  std::map<SubmapKey, Connection> loops_;                   // of a submap with itself; known once complete
  std::set<PairKey> disabled_;                              // each the lesser key first
  int num_decisions_ = 0;
  std::vector<TreeEdge> tree_;  // between indices into OrderedSubmaps()
  SpanningForest forest_;
  LiveRefinement live_, live_task_;  // taken in; being made
  bool complete_ = false;
  MergedTransforms transforms_;
  std::map<std::string, double> readouts_;
};

}  // namespace mapmend

#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/mapping/merged_refinement.h"
#include "procs/merger/connection.h"
#include "procs/merger/cycle_consistency.h"
#include "procs/merger/merged_transforms.h"

namespace mapmend {

struct MergerCursor {
  std::string session;
  int64_t seq = -1;
};

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

// Where every submap stands.
struct MergedTransforms {
  int64_t revision = 0;   // grows with the stream: 2 * records consumed, + 1 if refined
  std::vector<MergerCursor> cursors;
  bool refined = false, is_final = false;
  struct Place {
    SubmapKey key;
    int component = 0;    // 0: the one with most frames
    Similarity3 root_from_submap;
    bool is_root = false;
  };
  std::vector<Place> submaps;               // oldest first
  std::vector<std::pair<int, int>> edges;   // of the tree: indices into submaps
};

// One submap of a refined map.
struct RefinedSubmap {
  SubmapKey key;
  struct Keyframe {
    KeyframeId id;
    Rigid3 cam_from_root;
    double scale = 1;
  };
  struct Point {
    MapPointId id;
    Eigen::Vector3f position;
  };
  struct Fused {
    MapPointId id;
    SubmapKey into_submap;
    MapPointId into;
  };
  std::vector<Keyframe> keyframes;
  std::vector<Point> points;
  std::vector<Fused> fused;
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
  ConnectedFramesOptions connected_frames;
  ConnectionOptions connection;
  CycleConsistencyOptions cycles;
  MergedRefinementOptions refinement;
  int max_proposals = 20;            // asked of retrieval per keyframe
  int max_verified_per_submap = 3;   // of them looked at, per other submap, best first ...
  int max_accepted_per_submap = 1;   // ... until so many are accepted
  int max_evidence = 200;            // per connection: more adds cost and no knowledge
  int max_evaluated_again = 30;      // keyframes of an ended submap without a connection that are asked once more

  std::string Check() const;
};

// The merger proper, without LCM: consumes the stream, connects submaps, broadcasts transforms, and at the end refines the
// merged map (paper §3.6). A pure function of the stream: the same records give the same output, bit by bit.
// A keyframe is evaluated when the next record that can add map points to it has arrived: the following keyframe of its
// session, or the end of its submap.
class Merger {
 public:
  Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output);

  // The next record of its session. Returns an empty string, or why the record was refused.
  std::string Consume(const Record& record);

  // Every session seen has ended (and there is one).
  bool AllEnded() const;
  // The second pass: connections of all keyframes from scratch, with all submaps complete, also within a submap; then
  // refinement of every component, and the final revision. Depends only on the sessions' content, not on what happened live.
  void Finalize();

  // Connections a person has ruled out: kept deactivated in all that follows.
  void SetDisabled(const std::set<std::pair<SubmapKey, SubmapKey>>& disabled);

  const std::map<std::string, Session>& sessions() const { return sessions_; }
  int num_connections() const { return static_cast<int>(connections_.size()); }
  int num_accepted() const;
  int num_components() const { return num_components_; }
  int64_t revision() const { return transforms_.revision; }

 private:
  using PairKey = std::pair<SubmapKey, SubmapKey>;
  struct Loop {
    SubmapKey submap;
    ConnectedFrames frames;
  };

  SubmapView View(const SubmapKey& key) const;
  bool IsOlder(const SubmapKey& l, const SubmapKey& r) const;
  std::vector<SubmapKey> OrderedSubmaps() const;
  std::vector<MergerCursor> Cursors() const;

  // Asks for proposals and verifies them; pairs of submaps looked at are added to evaluated.
  void Evaluate(const std::string& session, SubmapId submap, KeyframeId keyframe, bool same_submap,
                std::set<PairKey>* evaluated);
  void EvaluatePending(const std::string& session, std::set<PairKey>* evaluated);
  void EvaluateAgain(const std::string& session, SubmapId submap, std::set<PairKey>* evaluated);
  // Estimates what changed, runs Kruskal with the cycle check, announces connections and transforms.
  void Update(const std::set<PairKey>& evaluated, bool announce_all);
  void Refine();

  MergerOptions options_;
  BowSource* bow_;
  MergerOutput* output_;
  std::map<std::string, Session> sessions_;
  int64_t num_records_ = 0;
  struct Pending {
    SubmapId submap;
    KeyframeId keyframe;
  };
  std::map<std::string, Pending> pending_;
  std::map<PairKey, Connection> connections_;
  std::set<PairKey> dirty_;            // edges whose evidence changed since they were estimated
  std::set<std::pair<std::string, KeyframeId>> connected_;  // keyframes with an accepted connected frame
  std::vector<Loop> loops_;
  std::set<PairKey> disabled_;
  MergedTransforms transforms_;
  int num_components_ = 0;
};

}  // namespace mapmend

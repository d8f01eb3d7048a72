#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connection_graph.h"
#include "libs/connecting/keyframe_cache.h"
#include "libs/connecting/neighbors_in_time.h"
#include "libs/connecting/submap_pair.h"
#include "libs/stream/store_questions.h"

namespace mapmend {

// Where the search asks for proposals: the store, over the bus; in tests, anything.
class BowSource {
 public:
  virtual ~BowSource() = default;
  // Best first. Throws std::runtime_error if there is no answer.
  virtual std::vector<BowProposal> Query(const BowQuestion& question) = 0;
};

struct ConnectionSearchOptions {
  ConnectedFramesOptions connected_frames;
  int max_proposals = 20;            // asked of retrieval per keyframe
  int max_verified_per_submap = 3;   // proposals verified per other submap, the best first ...
  int max_accepted_per_submap = 1;   // ... until so many hold
  NeighborsInTimeOptions neighbors;  // verified besides
  int max_evaluated_again = 30;      // keyframes of an ended submap without a connection that are asked once more
  int max_cached_keyframes = 500;    // held complete; the others' bulk is read again when needed (keyframe_cache.h)

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("connected_frames", connected_frames);
    v("max_proposals", max_proposals, Range(1, 10000), "keyframes");
    v("max_verified_per_submap", max_verified_per_submap, Range(1, 10000), "keyframes");
    v("max_accepted_per_submap", max_accepted_per_submap, Range(1, 10000), "keyframes");
    v("neighbors", neighbors);
    v("max_evaluated_again", max_evaluated_again, Range(0, 1e6), "keyframes");
    v("max_cached_keyframes", max_cached_keyframes, Range(1, 1e9), "keyframes");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
  // Empty, or which options contradict each other.
  std::string Conflict() const;
};

// Section 3.3: which keyframes are connected frames. Decides which keyframes ask, and when: a keyframe is asked about
// when the map update that follows it has brought its map points, at the latest at the end of its submap. Retrieval and
// time propose, geometry verifies, and what it gives is added to the graph.
class ConnectionSearch {
 public:
  // keyframes: where to read what the cache does not hold; null: everything is held. progress: called during long work.
  // sessions, bow and keyframes must outlive the search.
  ConnectionSearch(const ConnectionSearchOptions& options, Sessions* sessions, BowSource* bow,
                   KeyframeSource* keyframes, std::function<void()> progress);

  void SetSeed(uint64_t seed) { options_.connected_frames.ransac.seed = seed; }
  uint64_t seed() const { return options_.connected_frames.ransac.seed; }
  const KeyframeCache& cache() const { return cache_; }

  void OnKeyframe(const SubmapKey& submap, KeyframeId keyframe);
  // The keyframes of the session that wait have their map points now. Returns the pairs of submaps that were looked at,
  // among them those of AskAgain since; nullopt if no keyframe has waited.
  std::optional<std::set<SubmapPair>> OnMapUpdate(const std::string& session, ConnectionGraph* graph);
  // Keyframes of the ended submap that have found no connection will be asked once more about the others that have
  // ended (those that grow ask themselves).
  std::set<SubmapPair> OnSubmapEnd(const SubmapKey& submap, ConnectionGraph* graph);
  // Asks one of them: all at once would hold up the keyframes that come.
  void AskAgain(ConnectionGraph* graph);

  // All keyframes from scratch, with all submaps complete, also within a submap; nothing is left to be asked. A pure
  // function of the sessions.
  std::set<SubmapPair> SearchAll(ConnectionGraph* graph);

 private:
  enum class Among { kOthers, kEndedOthers, kAll };
  using Asked = std::pair<SubmapKey, KeyframeId>;
  struct Waiting {
    std::map<std::string, std::vector<Asked>> for_points;  // by session
    std::deque<Asked> again;
    std::set<SubmapPair> looked_at_again;  // not told yet
    std::set<std::pair<std::string, KeyframeId>> connected;
  };
  // What one keyframe's proposals have come to, per other submap.
  struct Tally {
    int looked_at = 0, accepted = 0;
  };

  bool HasKeyframe(const SubmapKey& submap, KeyframeId keyframe) const;
  void Ask(const SubmapKey& submap, KeyframeId keyframe, Among among, ConnectionGraph* graph,
           std::set<SubmapPair>* looked_at);
  std::set<SubmapPair> AskWaiting(const std::string& session, ConnectionGraph* graph);
  void AskRetrieval(const Asked& query, Among among, ConnectionGraph* graph, std::set<SubmapPair>* looked_at,
                    std::map<SubmapKey, Tally>* tally);
  // True if the two keyframes are connected frames.
  bool VerifyPair(const Asked& query, const Asked& other, ConnectionGraph* graph, std::set<SubmapPair>* looked_at);
  bool VerifyLoop(const SubmapKey& submap, KeyframeId a, KeyframeId b, ConnectionGraph* graph);
  // VerifyConnectedFrames with all the keyframes that it looks at complete.
  ConnectedFrames Verify(const SubmapKey& a, KeyframeId keyframe_a, const SubmapKey& b, KeyframeId keyframe_b);

  ConnectionSearchOptions options_;
  Sessions* sessions_;
  BowSource* bow_;
  std::function<void()> progress_;
  KeyframeCache cache_;
  Waiting waiting_;
};

}  // namespace mapmend

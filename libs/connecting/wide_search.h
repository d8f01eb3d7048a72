#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connection_graph.h"
#include "libs/connecting/keyframe_cache.h"
#include "libs/connecting/wide_connection.h"
#include "libs/connecting/wide_extension.h"

namespace mapmend {

struct WideSearchOptions {
  WideConnectionOptions connection;
  WideExtensionOptions extension;
  int max_frames = 8;  // of one end of a submap that are looked at
  int num_submaps =
      3;  // earlier ones of the session that a submap's beginning is compared with: short bad ones lie between
  // Submaps that follow each other in time and are connected otherwise by fewer common points are looked at as well.
  int weak_common_points = 100;
  double max_disagreement_px = 40;  // median, of that connection's matches with what wide features say
  int max_pairs = 60;  // of ends of submaps that are compared besides, those that look most alike first ...
  int min_alike = 12;  // ... by matches of one frame of each, at least so many

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("connection", connection);
    v("extension", extension);
    v("max_frames", max_frames, Range(2, 1000), "frames");
    v("num_submaps", num_submaps, Range(1, 1000), "submaps");
    v("weak_common_points", weak_common_points, Range(0, 1e6), "points");
    v("max_disagreement_px", max_disagreement_px, MoreThan(0), "pixels");
    v("max_pairs", max_pairs, Range(0, 1e6));
    v("min_alike", min_alike, Range(0, 1e6), "matches");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Bridges gaps between submaps that nothing else has joined: those that follow each other in time, then whatever looks
// alike at its ends. Only submaps that have ended, and only where the stream has brought wide features.
class WideSearch {
 public:
  // keyframes: where wide features are read from that the sessions do not hold; null: they hold them all.
  WideSearch(const WideSearchOptions& options, const Sessions* sessions, KeyframeSource* keyframes,
             std::function<void()> progress)
      : options_(options), sessions_(sessions), keyframes_(keyframes), progress_(std::move(progress)) {}

  void SetSeed(uint64_t seed) { options_.connection.registration.seed = options_.extension.seed = seed; }

  // Solves the graph, adds what it finds to it, and solves it again after each connection. Returns the pairs looked at.
  // A pure function of the sessions and the graph.
  std::set<SubmapPair> Bridge(ConnectionGraph* graph);
  int num_verified() const { return num_verified_; }

 private:
  enum class End { kBegin, kEnd };
  struct SideKey {
    SubmapKey submap;
    End end;
    auto operator<=>(const SideKey&) const = default;
  };
  struct Candidate {
    SideKey a, b;
    int num_alike = 0;
  };

  bool HasWide(const SubmapKey& key) const;
  std::vector<SubmapKey> WideSubmaps() const;
  const WideSide& Side(const SideKey& key);
  // Frames of one end of a submap, ascending by time.
  std::vector<WideFrame> Frames(const SideKey& key) const;
  std::shared_ptr<const WideFeatures> Features(const SubmapKey& key, const SubmapWideFeatures& wide) const;
  // Frames that were not tracked, next to this end, the nearest first; `keyframe` stands for them.
  std::vector<WideFrame> FramesBeyond(const SideKey& key, KeyframeId keyframe) const;
  // Whether there is a connection that few points support.
  bool IsWeak(const ConnectionGraph& graph, const SubmapKey& a, const SubmapKey& b) const;
  bool AreApart(const ConnectionGraph& graph, const SubmapKey& a, const SubmapKey& b) const;
  void BridgeInTime(ConnectionGraph* graph, std::set<SubmapPair>* looked_at);
  void BridgeAlike(ConnectionGraph* graph, std::set<SubmapPair>* looked_at);
  // True if the two are joined now.
  bool Verify(const SideKey& a, const SideKey& b, ConnectionGraph* graph, std::set<SubmapPair>* looked_at);

  WideSearchOptions options_;
  const Sessions* sessions_;
  KeyframeSource* keyframes_;
  std::function<void()> progress_;
  std::map<SideKey, WideSide> sides_;  // of one Bridge
  std::set<std::pair<SideKey, SideKey>> verified_;
  int num_verified_ = 0;
};

}  // namespace mapmend

#pragma once

#include <list>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "libs/retrieval/adaptive_thresholds.h"
#include "libs/retrieval/inverted_index.h"
#include "libs/stream/store_questions.h"
#include "libs/stream/submap.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/submap_tracker.h"

namespace mapmend {

struct BowSearchOptions {
  ThresholdOptions thresholds;
  SelectionOptions selection;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("thresholds", thresholds);
    v("selection", selection);
  }
};

// Retrieval of connected-frame candidates (paper section 3.3) over everything that is committed, as of the records that
// a query names. The index is in memory and made from the file on opening; the covisibility of submaps that were still
// growing is read from the file when needed.
class BowSearch {
 public:
  BowSearch(const BowSearchOptions& options, Database* database) : options_(options), database_(database) {}

  // What has been committed, in order. sessions are known by the number of their row.
  void AddSession(const SessionRow& session);
  void StartSubmap(int64_t session, SubmapId submap, int64_t seq);
  void AddKeyframe(int64_t session, SubmapId submap, KeyframeId keyframe, int64_t seq, const BowVector& bow);
  void RemoveKeyframe(int64_t session, KeyframeId keyframe, int64_t seq);
  void EndSubmap(int64_t session, SubmapId submap, int64_t seq);
  // Covisible keyframes at the end of a submap, strongest first: saves reading them from the file.
  void SetCovisible(int64_t session, KeyframeId keyframe, const std::vector<int32_t>& covisible);
  void FinishSubmap(int64_t session, SubmapId submap);

  // Adds all of a file.
  void Load();

  BowAnswer Query(const BowQuery& query);
  // Committed: the last record of a session that is in the file.
  void SetCumulative(int64_t session, int64_t seq) { sessions_.at(session).row.cumulative = seq; }

  int NumKeyframes() const { return index_.Size(); }
  int64_t Bytes() const;

 private:
  struct SessionInfo {
    SessionRow row;
    std::unordered_map<int32_t, int32_t> handles;  // by keyframe
  };
  struct SubmapInfo {
    int64_t start_seq = 0, end_seq = -1;  // -1: still growing
    bool is_final = false;                // covisible_ holds its keyframes
  };
  using SubmapIndex = std::pair<int64_t, SubmapId>;  // session, submap
  struct CachedTracker {
    std::string requester;
    SubmapIndex submap;
    SubmapTracker tracker;
  };

  // The keyframe that a query asks about, as of the records that it names.
  struct Asked {
    BowAnswer::Status status = BowAnswer::Status::kOk;  // if not, the rest is not set
    const SessionInfo* session = nullptr;
    IndexEntry entry;
    int32_t handle = -1;
    const Submap* submap = nullptr;
  };

  const SessionInfo* FindSession(const std::string& uuid) const;
  // Fills in how much of each session counts, and the order of sessions, which must not depend on that of their rows.
  BowAnswer::Status MakeScope(const std::vector<StreamCursor>& cursors, IndexScope* scope) const;
  Asked FindAsked(const BowQuery& query, const IndexScope& scope);
  // Neighbours and thresholds of the keyframe asked about go into the answer; returns the thresholds.
  AdaptiveThresholds DescribeAsked(const Asked& asked, const std::map<KeyframeId, int>& shared_points,
                                   BowAnswer* answer) const;
  void Propose(const Selection& selection, BowAnswer* answer) const;
  const Submap& AsOf(const std::string& requester, const SubmapIndex& submap, int64_t seq);
  std::vector<int32_t> Covisible(const std::string& requester, int32_t handle, int64_t seq);
  std::vector<int32_t> ToHandles(int64_t session, const std::vector<KeyframeId>& keyframes) const;

  const BowSearchOptions options_;
  Database* database_;
  std::map<int64_t, SessionInfo> sessions_;  // by row number
  std::map<SubmapIndex, SubmapInfo> submaps_;
  InvertedIndex index_;
  std::vector<std::vector<int32_t>> covisible_;  // per handle, handles
  std::list<CachedTracker> trackers_;            // most recently used first
};

}  // namespace mapmend

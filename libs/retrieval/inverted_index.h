#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "libs/retrieval/bow_vector.h"

namespace mapmend {

// What the index must know of a keyframe to answer "as of" a record of the stream. Sessions are numbered by the caller:
// small numbers from 0.
struct IndexEntry {
  int32_t session = 0;
  int32_t submap = 0;
  int32_t keyframe = 0;
  int64_t seq = 0;                                            // record that brought the keyframe
  int64_t removed_seq = std::numeric_limits<int64_t>::max();  // record that culled it
};

// Which entries a query searches.
struct IndexScope {
  // Per session number: search the keyframes that exist after record last_seq; -1, or beyond the end of the vector:
  // none.
  std::vector<int64_t> last_seq = {};
  // Per session number, its rank among equals: hits with equal scores are ordered by it, then by keyframe id. Empty: by
  // number.
  std::vector<int32_t> session_rank = {};
  // This submap is not searched; -1: all are.
  int32_t excluded_session = -1, excluded_submap = -1;
  // Nor are these handles (the query itself, its covisible neighbours). Any order.
  std::vector<int32_t> excluded_handles = {};
};

// A keyframe that shares words with the query.
struct IndexHit {
  int32_t handle = -1;
  int32_t common_words = 0;
  int32_t num_words = 0;  // of the keyframe
  float score = 0;        // L1, as BowScore, summed in fixed point
};

// Inverted index over the BoW vectors of keyframes, in memory: per word the keyframes that hold it. A handle is the
// position at which the keyframe was added: 0, 1, 2, ... Removal only marks, so that older states can still be asked
// for. One writer or many readers at a time.
class InvertedIndex {
 public:
  static constexpr int32_t kMaxWords = 1 << 24;  // of a vocabulary
  static constexpr int32_t kMaxSessions = 1 << 20;

  // Throws std::invalid_argument if words are not ascending, not in [0, kMaxWords), or lengths differ; then nothing is
  // added.
  int32_t Add(const BowVector& bow, const IndexEntry& entry);
  void Remove(int32_t handle, int64_t removed_seq);

  // Throws as Add does. Every entry in scope with at least one common word, ordered by (session_rank, keyframe). Sums
  // are made in a fixed order: equal contents give equal bits, whatever the order in which keyframes were added.
  std::vector<IndexHit> Query(const BowVector& query, const IndexScope& scope) const;

  int Size() const { return static_cast<int>(entries_.size()); }
  const IndexEntry& Entry(int32_t handle) const { return entries_[handle]; }
  int32_t NumWords(int32_t handle) const { return num_words_[handle]; }
  // Heap memory held.
  int64_t Bytes() const;

 private:
  struct Posting {
    int32_t handle;
    uint32_t weight;  // in units of 1 / kWeightOne
  };
  static constexpr uint32_t kWeightOne = 1u << 28;
  // Lists of words come in pages, so that a small index of a large vocabulary (or a forged word id) costs little.
  static constexpr int kPageWords = 1024;
  using Page = std::vector<std::vector<Posting>>;

  const std::vector<Posting>* Find(int32_t word) const;
  bool IsInScope(const IndexEntry& entry, const IndexScope& scope) const;

  std::vector<IndexEntry> entries_;             // per handle
  std::vector<int32_t> num_words_;              // per handle
  std::vector<std::vector<int32_t>> sessions_;  // per session number its handles, ascending by keyframe
  std::vector<Page> pages_;  // per word its keyframes, ascending by handle; pages never used are empty
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <limits>
#include <memory>
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

// Common words of a hit as they are compared: a keyframe with more words than the query shares more by mere size, so
// its count is scaled down to the query's size. (ORB-SLAM3's candidates are all keyframes of initialisation, which have
// five times the features, because it compares plain counts.)
double NormalizedCommonWords(int common_words, int num_words, int num_query_words);

// BoW vectors of keyframes in memory, and per word the keyframes that hold it. A handle is the position at which the
// keyframe was added: 0, 1, 2, ... Removal only marks, so that older states can still be asked for. One writer or many
// readers at a time.
//
// A query counts common words over the lists, and computes scores only of those keyframes whose counts suffice, from
// their own vectors. So the lists hold two bytes per entry: keyframes come in segments, whose counters stay in the
// processor's nearest cache.
class InvertedIndex {
 public:
  static constexpr int32_t kMaxWords = 1 << 24;  // of a vocabulary
  static constexpr int32_t kMaxSessions = 1 << 20;

  // Throws std::invalid_argument if words are not ascending, not in [0, kMaxWords), or lengths differ; then nothing is
  // added.
  int32_t Add(const BowVector& bow, const IndexEntry& entry);
  void Remove(int32_t handle, int64_t removed_seq);

  // Throws as Add does. Every entry in scope with at least one common word, and normalised common words of at least
  // min_ratio (0 to 1) of the most that any in scope has; ordered by (session_rank, keyframe). Sums are made in a fixed
  // order: equal contents give equal bits, whatever the order in which keyframes were added.
  std::vector<IndexHit> Query(const BowVector& query, const IndexScope& scope, double min_ratio = 0) const;

  int Size() const { return static_cast<int>(entries_.size()); }
  const IndexEntry& Entry(int32_t handle) const { return entries_[handle]; }
  // As it was added.
  const BowVector& Bow(int32_t handle) const { return vectors_[handle]; }
  // Heap memory held.
  int64_t Bytes() const;

 private:
  static constexpr int32_t kSegmentSize = 1 << 13;  // keyframes
  // Lists of words come in pages, so that a small index of a large vocabulary (or a forged word id) costs little.
  static constexpr int32_t kPageWords = 1024;

  // Numbers of keyframes within their segment, ascending. One pointer, since most of a hundred thousand lists are
  // short.
  class PostingList {
   public:
    void Append(uint16_t value);
    int Size() const { return block_ ? block_[0] : 0; }
    const uint16_t* begin() const { return block_.get() + kHeader; }
    const uint16_t* end() const { return begin() + Size(); }
    const void* Address() const { return block_.get(); }
    int64_t Bytes() const;

   private:
    static constexpr int kHeader = 2;    // size, capacity
    std::unique_ptr<uint16_t[]> block_;  // never null when read: begin() needs Size() > 0
  };
  using Page = std::vector<PostingList>;
  using Segment = std::vector<Page>;  // pages never used are empty

  bool IsInScope(const IndexEntry& entry, const IndexScope& scope) const;
  // Adds to counters[0 .. kSegmentSize) the words that each keyframe of the segment shares with the query.
  template <typename Counter>
  void Count(const Segment& segment, const BowVector& query, Counter* counters) const;
  template <typename Counter>
  std::vector<IndexHit> CollectHits(const BowVector& query, const IndexScope& scope, double min_ratio) const;

  std::vector<IndexEntry> entries_;  // per handle
  std::vector<BowVector> vectors_;   // per handle
  std::vector<Segment> segments_;
};

}  // namespace mapmend

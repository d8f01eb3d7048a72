#include "libs/retrieval/inverted_index.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <tuple>

namespace mapmend {
namespace {

// Scores are sums of whole numbers in units of 1 / kWeightOne: no order of addition changes them.
constexpr uint32_t kWeightOne = 1u << 28;

void CheckBow(const BowVector& bow) {
  if (bow.words.size() != bow.weights.size())
    throw std::invalid_argument("BoW vector: words and weights differ in length");
  for (size_t i = 0; i < bow.words.size(); ++i) {
    if (bow.words[i] < 0 || bow.words[i] >= InvertedIndex::kMaxWords || (i > 0 && bow.words[i] <= bow.words[i - 1])) {
      throw std::invalid_argument("BoW vector: word ids must be ascending and in range");
    }
  }
}

// Weights beyond [0, 1], and what is no number, become the nearest bound, 0 respectively.
uint32_t FixedPoint(float weight) {
  if (!(weight > 0)) return 0;
  return weight >= 1 ? kWeightOne : static_cast<uint32_t>(weight * static_cast<float>(kWeightOne) + 0.5f);
}

// The query's weights by word: a hash table with open addressing, at most a quarter full.
class QueryWeights {
 public:
  explicit QueryWeights(const BowVector& query)
      : shift_(32 - std::bit_width(static_cast<uint32_t>(4 * query.Size() + 1))),
        slots_(size_t{1} << (32 - shift_), Slot{-1, 0}) {
    // Weights sum to 1 unless they are nonsense: then the sum is limited to what a score can hold.
    uint32_t left = std::numeric_limits<uint32_t>::max();
    for (int i = 0; i < query.Size(); ++i) {
      const uint32_t weight = std::min(left, FixedPoint(query.weights[i]));
      left -= weight;
      size_t at = Start(query.words[i]);
      while (slots_[at].word >= 0) at = (at + 1) & (slots_.size() - 1);
      slots_[at] = {query.words[i], weight};
    }
  }

  float Score(const BowVector& bow) const {
    uint32_t sum = 0;
    for (int i = 0; i < bow.Size(); ++i) {
      const int32_t word = bow.words[i];
      size_t at = Start(word);
      while (slots_[at].word >= 0 && slots_[at].word != word) at = (at + 1) & (slots_.size() - 1);
      if (slots_[at].word == word) sum += std::min(slots_[at].weight, FixedPoint(bow.weights[i]));
    }
    return static_cast<float>(sum) / kWeightOne;
  }

 private:
  struct Slot {
    int32_t word;  // -1: free
    uint32_t weight;
  };
  size_t Start(int32_t word) const { return static_cast<uint32_t>(word) * 2654435769u >> shift_; }

  int shift_;
  std::vector<Slot> slots_;
};

}  // namespace

double NormalizedCommonWords(int common_words, int num_words, int num_query_words) {
  if (num_words <= num_query_words) return common_words;
  return static_cast<double>(common_words) * num_query_words / num_words;
}

void InvertedIndex::PostingList::Append(uint16_t value) {
  const int size = Size();
  if (!block_ || size == block_[1]) {
    // Grows by a quarter only: with a hundred thousand lists, doubling would leave a third of the memory unused. What
    // malloc takes is 16 n bytes of which it keeps 8.
    const int wanted = std::min(size + size / 4 + 2, kSegmentSize);
    const int slots = ((wanted + kHeader) * 2 + 8 + 15) / 16 * 8 - 4;
    std::unique_ptr<uint16_t[]> grown(new uint16_t[slots]);
    if (size > 0) std::copy(begin(), end(), grown.get() + kHeader);
    grown[1] = static_cast<uint16_t>(slots - kHeader);
    block_ = std::move(grown);
  }
  block_[kHeader + size] = value;
  block_[0] = static_cast<uint16_t>(size + 1);
}

int64_t InvertedIndex::PostingList::Bytes() const { return block_ ? (block_[1] + kHeader) * 2 + 8 : 0; }

int32_t InvertedIndex::Add(const BowVector& bow, const IndexEntry& entry) {
  CheckBow(bow);
  if (entry.session < 0 || entry.session >= kMaxSessions)
    throw std::invalid_argument("index: session number out of range");
  const int32_t handle = Size();
  entries_.push_back(entry);
  vectors_.push_back(bow);
  segments_.resize(handle / kSegmentSize + 1);
  Segment& segment = segments_.back();
  if (!bow.words.empty() && segment.size() <= static_cast<size_t>(bow.words.back() / kPageWords)) {
    segment.resize(bow.words.back() / kPageWords + 1);
  }
  for (const int32_t word : bow.words) {
    Page& page = segment[word / kPageWords];
    if (page.empty()) page.resize(kPageWords);
    page[word % kPageWords].Append(static_cast<uint16_t>(handle % kSegmentSize));
  }
  return handle;
}

void InvertedIndex::Remove(int32_t handle, int64_t removed_seq) { entries_[handle].removed_seq = removed_seq; }

bool InvertedIndex::IsInScope(const IndexEntry& entry, const IndexScope& scope) const {
  if (static_cast<size_t>(entry.session) >= scope.last_seq.size()) return false;
  const int64_t last_seq = scope.last_seq[entry.session];
  if (entry.seq > last_seq || entry.removed_seq <= last_seq) return false;
  return entry.session != scope.excluded_session || entry.submap != scope.excluded_submap;
}

template <typename Counter>
void InvertedIndex::Count(const Segment& segment, const BowVector& query, Counter* counters) const {
  std::vector<const PostingList*> lists;
  lists.reserve(query.words.size());
  for (const int32_t word : query.words) {
    const size_t page = word / kPageWords;
    if (page >= segment.size() || segment[page].empty()) continue;
    const PostingList& list = segment[page][word % kPageWords];
    if (list.Address() == nullptr) continue;
    __builtin_prefetch(list.Address());  // each list is a cache miss: let them overlap
    lists.push_back(&list);
  }
  for (const PostingList* list : lists) {
    for (const uint16_t keyframe : *list) ++counters[keyframe];
  }
}

template <typename Counter>
std::vector<IndexHit> InvertedIndex::CollectHits(const BowVector& query, const IndexScope& scope,
                                                 double min_ratio) const {
  std::vector<Counter> counts(segments_.size() * kSegmentSize, 0);
  for (size_t i = 0; i < segments_.size(); ++i) Count(segments_[i], query, &counts[i * kSegmentSize]);
  for (const int32_t handle : scope.excluded_handles) {
    if (handle >= 0 && handle < Size()) counts[handle] = 0;
  }
  // The most found so far bounds the most of all from below: most keyframes are left out without a look at them.
  std::vector<IndexHit> hits;
  double most = 0;
  for (int32_t handle = 0; handle < Size(); ++handle) {
    const auto common_words = static_cast<int32_t>(counts[handle]);
    if (common_words == 0 || common_words < min_ratio * most || !IsInScope(entries_[handle], scope)) continue;
    const int num_words = vectors_[handle].Size();
    most = std::max(most, NormalizedCommonWords(common_words, num_words, query.Size()));
    hits.push_back({handle, common_words, num_words, 0});
  }
  std::erase_if(hits, [&](const IndexHit& hit) {
    return NormalizedCommonWords(hit.common_words, hit.num_words, query.Size()) < min_ratio * most;
  });
  return hits;
}

std::vector<IndexHit> InvertedIndex::Query(const BowVector& query, const IndexScope& scope, double min_ratio) const {
  CheckBow(query);
  std::vector<IndexHit> hits = query.Size() <= std::numeric_limits<uint16_t>::max()
                                   ? CollectHits<uint16_t>(query, scope, min_ratio)
                                   : CollectHits<uint32_t>(query, scope, min_ratio);
  const auto key = [&](const IndexHit& hit) {
    const IndexEntry& entry = entries_[hit.handle];
    const auto session = static_cast<size_t>(entry.session);
    return std::tuple(session < scope.session_rank.size() ? scope.session_rank[session] : entry.session, entry.session,
                      entry.keyframe, hit.handle);
  };
  std::sort(hits.begin(), hits.end(), [&](const IndexHit& a, const IndexHit& b) { return key(a) < key(b); });
  const QueryWeights weights(query);
  for (IndexHit& hit : hits) hit.score = weights.Score(vectors_[hit.handle]);
  return hits;
}

int64_t InvertedIndex::Bytes() const {
  const auto block = [](size_t bytes) { return bytes == 0 ? 0 : static_cast<int64_t>((bytes + 8 + 15) / 16 * 16); };
  int64_t bytes =
      static_cast<int64_t>(entries_.capacity() * sizeof(IndexEntry) + vectors_.capacity() * sizeof(BowVector) +
                           segments_.capacity() * sizeof(Segment));
  for (const BowVector& vector : vectors_) {
    bytes += block(vector.words.capacity() * sizeof(int32_t)) + block(vector.weights.capacity() * sizeof(float));
  }
  for (const Segment& segment : segments_) {
    bytes += block(segment.capacity() * sizeof(Page));
    for (const Page& page : segment) {
      bytes += block(page.capacity() * sizeof(PostingList));
      for (const PostingList& list : page) bytes += list.Bytes();
    }
  }
  return bytes;
}

}  // namespace mapmend

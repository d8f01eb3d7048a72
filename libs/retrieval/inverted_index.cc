#include "libs/retrieval/inverted_index.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

namespace mapmend {
namespace {

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
uint32_t FixedPoint(float weight, uint32_t one) {
  if (!(weight > 0)) return 0;
  return weight >= 1 ? one : static_cast<uint32_t>(weight * static_cast<float>(one) + 0.5f);
}

}  // namespace

int32_t InvertedIndex::Add(const BowVector& bow, const IndexEntry& entry) {
  CheckBow(bow);
  if (entry.session < 0 || entry.session >= kMaxSessions)
    throw std::invalid_argument("index: session number out of range");
  const int32_t handle = Size();
  if (static_cast<size_t>(entry.session) >= sessions_.size()) sessions_.resize(entry.session + 1);
  std::vector<int32_t>& session = sessions_[entry.session];
  session.insert(std::upper_bound(session.begin(), session.end(), entry.keyframe,
                                  [&](int32_t keyframe, int32_t h) { return keyframe < entries_[h].keyframe; }),
                 handle);
  entries_.push_back(entry);
  num_words_.push_back(bow.Size());
  for (int i = 0; i < bow.Size(); ++i) {
    const size_t page = bow.words[i] / kPageWords;
    if (page >= pages_.size()) pages_.resize(page + 1);
    if (pages_[page].empty()) pages_[page].resize(kPageWords);
    std::vector<Posting>& list = pages_[page][bow.words[i] % kPageWords];
    // Grows by a quarter only: with a hundred thousand lists, doubling would leave a third of the memory unused.
    if (list.size() == list.capacity()) list.reserve(list.size() + list.size() / 4 + 2);
    list.push_back({handle, FixedPoint(bow.weights[i], kWeightOne)});
  }
  return handle;
}

const std::vector<InvertedIndex::Posting>* InvertedIndex::Find(int32_t word) const {
  const size_t page = word / kPageWords;
  if (page >= pages_.size() || pages_[page].empty()) return nullptr;
  return &pages_[page][word % kPageWords];
}

void InvertedIndex::Remove(int32_t handle, int64_t removed_seq) { entries_[handle].removed_seq = removed_seq; }

bool InvertedIndex::IsInScope(const IndexEntry& entry, const IndexScope& scope) const {
  const int64_t last_seq = scope.last_seq[entry.session];
  if (entry.seq > last_seq || entry.removed_seq <= last_seq) return false;
  return entry.session != scope.excluded_session || entry.submap != scope.excluded_submap;
}

std::vector<IndexHit> InvertedIndex::Query(const BowVector& query, const IndexScope& scope) const {
  CheckBow(query);
  // Upper half: common words; lower half: score. One addition serves both, and the query's weights are limited to what
  // the lower half can hold (they sum to 1 unless they are nonsense).
  std::vector<uint64_t> sums(entries_.size(), 0);
  uint32_t left = std::numeric_limits<uint32_t>::max();
  for (int i = 0; i < query.Size(); ++i) {
    const uint32_t weight = std::min(left, FixedPoint(query.weights[i], kWeightOne));
    left -= weight;
    const std::vector<Posting>* list = Find(query.words[i]);
    if (!list) continue;
    for (const Posting& p : *list) sums[p.handle] += (uint64_t{1} << 32) + std::min(weight, p.weight);
  }
  for (const int32_t handle : scope.excluded_handles) {
    if (handle >= 0 && handle < Size()) sums[handle] = 0;
  }
  std::vector<int32_t> order(std::min(sessions_.size(), scope.last_seq.size()));
  std::iota(order.begin(), order.end(), 0);
  const auto rank = [&](int32_t session) {
    return static_cast<size_t>(session) < scope.session_rank.size() ? scope.session_rank[session] : session;
  };
  std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return rank(a) < rank(b); });
  std::vector<IndexHit> hits;
  for (const int32_t session : order) {
    for (const int32_t handle : sessions_[session]) {
      if (sums[handle] == 0 || !IsInScope(entries_[handle], scope)) continue;
      hits.push_back({handle, static_cast<int32_t>(sums[handle] >> 32), num_words_[handle],
                      static_cast<float>(static_cast<uint32_t>(sums[handle])) / kWeightOne});
    }
  }
  return hits;
}

int64_t InvertedIndex::Bytes() const {
  constexpr int64_t kMallocHeader = 8, kMallocStep = 16;
  int64_t bytes = static_cast<int64_t>(entries_.capacity() * sizeof(IndexEntry) +
                                       num_words_.capacity() * sizeof(int32_t) + pages_.capacity() * sizeof(Page));
  for (const auto& session : sessions_) bytes += static_cast<int64_t>(session.capacity() * sizeof(int32_t));
  for (const Page& page : pages_) {
    bytes += static_cast<int64_t>(page.capacity() * sizeof(page[0]));
    for (const std::vector<Posting>& list : page) {
      if (list.capacity() == 0) continue;
      const int64_t size = static_cast<int64_t>(list.capacity() * sizeof(Posting)) + kMallocHeader;
      bytes += (size + kMallocStep - 1) / kMallocStep * kMallocStep;
    }
  }
  return bytes;
}

}  // namespace mapmend

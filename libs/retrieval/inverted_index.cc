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
    list.push_back({handle, bow.weights[i]});
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
  struct Sum {
    int32_t common_words = 0;
    float score = 0;
  };
  CheckBow(query);
  std::vector<Sum> sums(entries_.size());
  for (int i = 0; i < query.Size(); ++i) {
    const std::vector<Posting>* list = Find(query.words[i]);
    if (!list) continue;
    const float weight = query.weights[i];
    for (const Posting& p : *list) {
      Sum& sum = sums[p.handle];
      ++sum.common_words;
      sum.score += std::min(weight, p.weight);
    }
  }
  for (const int32_t handle : scope.excluded_handles) {
    if (handle >= 0 && handle < Size()) sums[handle].common_words = 0;
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
      const Sum& sum = sums[handle];
      if (sum.common_words > 0 && IsInScope(entries_[handle], scope)) {
        hits.push_back({handle, sum.common_words, num_words_[handle], sum.score});
      }
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

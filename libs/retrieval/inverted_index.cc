#include "libs/retrieval/inverted_index.h"

#include <algorithm>
#include <stdexcept>
#include <tuple>

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
  const int32_t handle = Size();
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
  if (entry.session < 0 || static_cast<size_t>(entry.session) >= scope.last_seq.size()) return false;
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
  std::vector<IndexHit> hits;
  for (int32_t handle = 0; handle < Size(); ++handle) {
    const Sum& sum = sums[handle];
    if (sum.common_words > 0 && IsInScope(entries_[handle], scope)) {
      hits.push_back({handle, sum.common_words, num_words_[handle], sum.score});
    }
  }
  const auto order = [&](const IndexHit& hit) {
    const IndexEntry& entry = entries_[hit.handle];
    const bool ranked = static_cast<size_t>(entry.session) < scope.session_rank.size();
    return std::tuple(ranked ? scope.session_rank[entry.session] : entry.session, entry.keyframe, hit.handle);
  };
  const auto before = [&](const IndexHit& a, const IndexHit& b) { return order(a) < order(b); };
  if (!std::is_sorted(hits.begin(), hits.end(), before)) std::sort(hits.begin(), hits.end(), before);
  return hits;
}

int64_t InvertedIndex::Bytes() const {
  constexpr int64_t kMallocHeader = 8, kMallocStep = 16;
  int64_t bytes = static_cast<int64_t>(entries_.capacity() * sizeof(IndexEntry) +
                                       num_words_.capacity() * sizeof(int32_t) + pages_.capacity() * sizeof(Page));
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

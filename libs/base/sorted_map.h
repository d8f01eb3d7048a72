#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

namespace mapmend {

// A map in one block of memory, ascending by key: what std::map takes for each entry beside the entry itself is as much
// again as a map point. Meant for keys that mostly come in ascending order and go soon after, if at all: a change moves
// all entries behind it. As with std::vector, changes invalidate references.
template <typename Key, typename Value>
class SortedMap {
 public:
  using value_type = std::pair<Key, Value>;
  using iterator = typename std::vector<value_type>::iterator;
  using const_iterator = typename std::vector<value_type>::const_iterator;

  iterator begin() { return entries_.begin(); }
  iterator end() { return entries_.end(); }
  const_iterator begin() const { return entries_.begin(); }
  const_iterator end() const { return entries_.end(); }
  size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }

  iterator lower_bound(const Key& key) { return std::lower_bound(begin(), end(), key, IsBefore); }
  const_iterator lower_bound(const Key& key) const { return std::lower_bound(begin(), end(), key, IsBefore); }
  iterator find(const Key& key) { return Exactly(lower_bound(key), end(), key); }
  const_iterator find(const Key& key) const { return Exactly(lower_bound(key), end(), key); }
  bool contains(const Key& key) const { return find(key) != end(); }
  // Throws std::out_of_range.
  Value& at(const Key& key) { return Checked(find(key), end())->second; }
  const Value& at(const Key& key) const { return Checked(find(key), end())->second; }

  Value& operator[](const Key& key) {
    if (empty() || entries_.back().first < key) return entries_.emplace_back(key, Value()).second;
    const iterator at = lower_bound(key);
    return at->first == key ? at->second : entries_.emplace(at, key, Value())->second;
  }
  iterator erase(const_iterator at) { return entries_.erase(at); }
  size_t erase(const Key& key) {
    const const_iterator at = find(key);
    if (at == end()) return 0;
    entries_.erase(at);
    return 1;
  }
  // All at once, in one pass over what lies behind the first of them; keys that are not there count as nothing.
  void EraseAll(std::vector<Key> keys) {
    std::sort(keys.begin(), keys.end());
    auto next = keys.begin();
    const iterator first = keys.empty() ? end() : lower_bound(*next);
    const auto is_erased = [&](const value_type& entry) {
      while (next != keys.end() && *next < entry.first) ++next;
      return next != keys.end() && *next == entry.first;
    };
    iterator kept = first;
    for (iterator at = first; at != end(); ++at) {
      if (is_erased(*at)) continue;
      if (kept != at) *kept = std::move(*at);
      ++kept;
    }
    entries_.erase(kept, end());
  }
  // Gives back what was set aside for entries to come.
  void shrink_to_fit() { entries_.shrink_to_fit(); }

 private:
  static bool IsBefore(const value_type& entry, const Key& key) { return entry.first < key; }
  template <typename It>
  static It Exactly(It at, It end, const Key& key) {
    return at != end && at->first == key ? at : end;
  }
  template <typename It>
  static It Checked(It at, It end) {
    if (at == end) throw std::out_of_range("SortedMap: no such key");
    return at;
  }

  std::vector<value_type> entries_;
};

}  // namespace mapmend

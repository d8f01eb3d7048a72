#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace mapmend {

// Counts how often each of many keys is voted for. Equal votes are counted together every now and then, so that memory
// goes by different keys and not by votes; a sorted list takes a tenth of the memory of a map.
template <typename Key>
class Votes {
 public:
  void Add(const Key& key) {
    if (counted_.size() == counted_.capacity()) {
      Count();
      counted_.reserve(std::max<size_t>(1024, 2 * counted_.size()));
    }
    counted_.emplace_back(key, 1);
  }
  // Most votes first; ties: the lesser key. Nothing is left.
  std::vector<std::pair<Key, int>> TakeRanked() {
    Count();
    std::vector<std::pair<Key, int>> ranked = std::exchange(counted_, {});
    std::sort(ranked.begin(), ranked.end(), [](const auto& l, const auto& r) {
      return l.second != r.second ? l.second > r.second : l.first < r.first;
    });
    return ranked;
  }

 private:
  void Count() {
    std::sort(counted_.begin(), counted_.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
    size_t size = 0;
    for (size_t i = 0; i < counted_.size(); ++i) {
      if (size > 0 && counted_[size - 1].first == counted_[i].first) {
        counted_[size - 1].second += counted_[i].second;
      } else {
        counted_[size++] = counted_[i];
      }
    }
    counted_.resize(size);
  }

  std::vector<std::pair<Key, int>> counted_;
};

}  // namespace mapmend

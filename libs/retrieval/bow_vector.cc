#include "libs/retrieval/bow_vector.h"

#include <algorithm>

namespace mapmend {
namespace {

// Calls visit(i, j) for every pair of positions with the same word.
template <typename Visit>
void ForEachCommonWord(const BowVector& a, const BowVector& b, Visit visit) {
  size_t i = 0, j = 0;
  while (i < a.words.size() && j < b.words.size()) {
    if (a.words[i] == b.words[j]) {
      visit(i++, j++);
    } else if (a.words[i] < b.words[j]) {
      ++i;
    } else {
      ++j;
    }
  }
}

}  // namespace

double BowScore(const BowVector& a, const BowVector& b) {
  // With both sums equal to 1, 1 - 0.5 * sum |a - b| = sum of min(a, b) over the common words.
  double score = 0;
  ForEachCommonWord(a, b, [&](size_t i, size_t j) { score += std::min(a.weights[i], b.weights[j]); });
  return score;
}

int CountCommonWords(const BowVector& a, const BowVector& b) {
  int count = 0;
  ForEachCommonWord(a, b, [&](size_t, size_t) { ++count; });
  return count;
}

}  // namespace mapmend

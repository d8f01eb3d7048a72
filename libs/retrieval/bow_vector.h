#pragma once

#include <cstdint>
#include <vector>

namespace mapmend {

// Bag of words of one image: ascending word ids and their tf-idf weights, which sum to 1 (L1).
struct BowVector {
  std::vector<int32_t> words;
  std::vector<float> weights;

  int Size() const { return static_cast<int>(words.size()); }
};

// L1 similarity in [0, 1]: 1 - 0.5 * sum |a_i - b_i| (Nistér and Stewénius, CVPR 2006).
double BowScore(const BowVector& a, const BowVector& b);

// Number of words in both.
int CountCommonWords(const BowVector& a, const BowVector& b);

}  // namespace mapmend

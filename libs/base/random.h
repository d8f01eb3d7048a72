#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace mapmend {

// SplitMix64 (Steele, Lea, Flood 2014): small, seeded, the same bits on every platform, unlike std::*_distribution.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}

  uint64_t Next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  // In [0, n); the bias for n far below 2^32 does not matter for sampling.
  int Below(int n) { return static_cast<int>((Next() >> 32) * static_cast<uint64_t>(n) >> 32); }
  // In [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }

  template <typename T>
  void Shuffle(std::vector<T>* values) {
    for (int i = static_cast<int>(values->size()) - 1; i > 0; --i) std::swap((*values)[i], (*values)[Below(i + 1)]);
  }

 private:
  uint64_t state_;
};

}  // namespace mapmend

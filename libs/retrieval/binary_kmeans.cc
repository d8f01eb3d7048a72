#include "libs/retrieval/binary_kmeans.h"

#include <algorithm>

namespace mapmend {
namespace {

// Counts set bits per position for many descriptors at once: plane p holds bit p of all 256 counters.
class BitCounters {
 public:
  void Add(const Descriptor& d) {
    Descriptor carry = d;
    for (size_t p = 0;; ++p) {
      if (p == planes_.size()) planes_.push_back({});
      uint64_t any = 0;
      for (int w = 0; w < 4; ++w) {
        const uint64_t overflow = planes_[p][w] & carry[w];
        planes_[p][w] ^= carry[w];
        carry[w] = overflow;
        any |= overflow;
      }
      if (any == 0) break;
    }
    ++count_;
  }

  // Bits set in more than half of the descriptors.
  Descriptor Majority() const {
    Descriptor result = {};
    for (int bit = 0; bit < 256; ++bit) {
      int64_t count = 0;
      for (size_t p = 0; p < planes_.size(); ++p) {
        count |= static_cast<int64_t>((planes_[p][bit / 64] >> (bit % 64)) & 1) << p;
      }
      if (2 * count > count_) result[bit / 64] |= uint64_t{1} << (bit % 64);
    }
    return result;
  }

  int64_t Count() const { return count_; }

 private:
  std::vector<Descriptor> planes_;
  int64_t count_ = 0;
};

std::vector<Descriptor> SeedCenters(std::span<const Descriptor> descriptors, int k, Random* random) {
  std::vector<Descriptor> centers = {descriptors[random->Next() % descriptors.size()]};
  std::vector<uint32_t> squared_distance(descriptors.size(), 256 * 256);
  while (static_cast<int>(centers.size()) < k) {
    uint64_t sum = 0;
    for (size_t i = 0; i < descriptors.size(); ++i) {
      const uint32_t d = static_cast<uint32_t>(HammingDistance(descriptors[i], centers.back()));
      squared_distance[i] = std::min(squared_distance[i], d * d);
      sum += squared_distance[i];
    }
    if (sum == 0) break;  // every descriptor is a center
    uint64_t at = random->Next() % sum;
    size_t chosen = 0;
    while (at >= squared_distance[chosen]) at -= squared_distance[chosen++];
    centers.push_back(descriptors[chosen]);
  }
  return centers;
}

int32_t Nearest(const Descriptor& d, const std::vector<Descriptor>& centers) {
  int32_t best = 0;
  int best_distance = 257;
  for (size_t c = 0; c < centers.size(); ++c) {
    const int distance = HammingDistance(d, centers[c]);
    if (distance < best_distance) {
      best_distance = distance;
      best = static_cast<int32_t>(c);
    }
  }
  return best;
}

}  // namespace

Descriptor MajorityDescriptor(std::span<const Descriptor> descriptors) {
  BitCounters counters;
  for (const Descriptor& d : descriptors) counters.Add(d);
  return counters.Majority();
}

BinaryClusters ClusterBinary(std::span<const Descriptor> descriptors, int k, int max_iterations, Random* random) {
  BinaryClusters clusters;
  if (descriptors.empty() || k < 1) return clusters;
  clusters.centers = SeedCenters(descriptors, k, random);
  clusters.assignment.assign(descriptors.size(), -1);
  for (int iteration = 0;; ++iteration) {
    bool changed = false;
    std::vector<int> count(clusters.centers.size(), 0);
    for (size_t i = 0; i < descriptors.size(); ++i) {
      const int32_t nearest = Nearest(descriptors[i], clusters.centers);
      changed |= nearest != clusters.assignment[i];
      clusters.assignment[i] = nearest;
      ++count[nearest];
    }
    // Centers that lost all descriptors go; removing them changes no assignment but its number.
    std::vector<int32_t> renumbered(count.size(), -1);
    size_t kept = 0;
    for (size_t c = 0; c < count.size(); ++c) {
      if (count[c] == 0) continue;
      clusters.centers[kept] = clusters.centers[c];
      renumbered[c] = static_cast<int32_t>(kept++);
    }
    clusters.centers.resize(kept);
    for (int32_t& a : clusters.assignment) a = renumbered[a];
    if (!changed || iteration == max_iterations) return clusters;

    std::vector<BitCounters> counters(kept);
    for (size_t i = 0; i < descriptors.size(); ++i) counters[clusters.assignment[i]].Add(descriptors[i]);
    for (size_t c = 0; c < kept; ++c) clusters.centers[c] = counters[c].Majority();
  }
}

}  // namespace mapmend

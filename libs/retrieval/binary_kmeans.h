#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "libs/base/random.h"
#include "libs/features/features.h"

namespace mapmend {

// Majority of each bit; ties give 0. Throws nothing; no descriptors give zeros.
Descriptor MajorityDescriptor(std::span<const Descriptor> descriptors);

struct BinaryClusters {
  std::vector<Descriptor> centers;  // at most k, none empty
  std::vector<int32_t> assignment;  // per descriptor, index of the nearest center (ties: lower index)
};

// k-majority clustering under the Hamming distance (Grana et al., IRCDL 2013), seeded as k-means++. Fewer than k
// clusters if there are fewer distinct descriptors.
BinaryClusters ClusterBinary(std::span<const Descriptor> descriptors, int k, int max_iterations, Random* random);

}  // namespace mapmend

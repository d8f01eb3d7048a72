#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/retrieval/vocabulary.h"

namespace mapmend {

struct VocabularyTrainerOptions {
  int branching_factor = 10;  // children per node
  int num_levels = 5;         // below the root; at most branching_factor^num_levels words
  int min_descriptors = 2;    // a node with fewer is not split further
  int max_iterations = 11;    // of each clustering
  uint64_t seed = 1;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("branching_factor", branching_factor, Range(2, 255));
    v("num_levels", num_levels, Range(1, 10));
    v("min_descriptors", min_descriptors, Range(2, 1e9));
    v("max_iterations", max_iterations, Range(1, 10000));
    v("seed", seed);
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Trains a vocabulary from the descriptors of many images: hierarchical k-majority clustering, then the idf of each
// word, ln(images / images with the word). Same input, options and seed give the same vocabulary on every machine.
//   progress  called now and then with the share done, 0 to 1; may be empty
// Throws std::invalid_argument for bad options or if there are no two different descriptors.
Vocabulary TrainVocabulary(const std::vector<std::vector<Descriptor>>& images, const VocabularyTrainerOptions& options,
                           const std::function<void(double share)>& progress = {});

}  // namespace mapmend

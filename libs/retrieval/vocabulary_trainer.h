#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "libs/retrieval/vocabulary.h"

namespace mapmend {

struct VocabularyTrainerOptions {
  int branching_factor = 10;  // children per node
  int num_levels = 5;         // below the root; at most branching_factor^num_levels words
  int min_descriptors = 2;    // a node with fewer is not split further
  int max_iterations = 11;    // of each clustering
  uint64_t seed = 1;

  // Throws std::invalid_argument naming the option.
  void Check() const;
};

// Trains a vocabulary from the descriptors of many images: hierarchical k-majority clustering, then the idf of each
// word, ln(images / images with the word). Same input, options and seed give the same vocabulary on every machine.
//   progress  called now and then with the share done, 0 to 1; may be empty
// Throws std::invalid_argument for bad options or if there are no two different descriptors.
Vocabulary TrainVocabulary(const std::vector<std::vector<Descriptor>>& images, const VocabularyTrainerOptions& options,
                           const std::function<void(double share)>& progress = {});

}  // namespace mapmend

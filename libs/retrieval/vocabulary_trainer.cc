#include "libs/retrieval/vocabulary_trainer.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

#include "libs/base/options.h"
#include "libs/retrieval/binary_kmeans.h"

namespace mapmend {
namespace {

struct Pending {
  int32_t node;
  size_t begin, end;  // its descriptors
  int depth;
};

// Splits nodes breadth first; the descriptors of a node are always one range, reordered in place.
VocabularyTree GrowTree(std::vector<Descriptor> descriptors, const VocabularyTrainerOptions& options,
                        const std::function<void(double)>& progress) {
  VocabularyTree tree;
  tree.branching_factor = options.branching_factor;
  tree.num_levels = options.num_levels;
  tree.descriptors = {Descriptor{}};
  tree.parents = {-1};
  Random random(options.seed);
  std::vector<Pending> queue = {{0, 0, descriptors.size(), 0}};
  std::vector<Descriptor> sorted;
  size_t work_done = 0;
  const size_t work = descriptors.size() * options.num_levels;
  for (size_t next = 0; next < queue.size(); ++next) {
    const Pending pending = queue[next];
    const size_t count = pending.end - pending.begin;
    const std::span<Descriptor> range(descriptors.data() + pending.begin, count);
    const BinaryClusters clusters = ClusterBinary(range, options.branching_factor, options.max_iterations, &random);
    if (progress && (work_done * 100 / work != (work_done + count) * 100 / work)) {
      progress(static_cast<double>(work_done + count) / static_cast<double>(work));
    }
    work_done += count;
    // A node with one kind of descriptor is a word.
    if (clusters.centers.size() < 2) continue;
    std::vector<size_t> begin(clusters.centers.size() + 1, 0);
    for (const int32_t a : clusters.assignment) ++begin[a + 1];
    for (size_t c = 0; c < clusters.centers.size(); ++c) begin[c + 1] += begin[c];
    sorted.resize(count);
    std::vector<size_t> at(begin.begin(), begin.end() - 1);
    for (size_t i = 0; i < count; ++i) sorted[at[clusters.assignment[i]]++] = range[i];
    std::copy(sorted.begin(), sorted.end(), range.begin());
    for (size_t c = 0; c < clusters.centers.size(); ++c) {
      const int32_t node = static_cast<int32_t>(tree.parents.size());
      tree.descriptors.push_back(clusters.centers[c]);
      tree.parents.push_back(pending.node);
      const size_t size = begin[c + 1] - begin[c];
      if (pending.depth + 1 < options.num_levels && size >= static_cast<size_t>(options.min_descriptors)) {
        queue.push_back({node, pending.begin + begin[c], pending.begin + begin[c + 1], pending.depth + 1});
      }
    }
  }
  tree.weights.assign(tree.parents.size(), 1.0f);
  return tree;
}

}  // namespace

std::string VocabularyTrainerOptions::Check() const { return CheckOptions(*this); }

Vocabulary TrainVocabulary(const std::vector<std::vector<Descriptor>>& images, const VocabularyTrainerOptions& options,
                           const std::function<void(double)>& progress) {
  if (const std::string error = options.Check(); !error.empty())
    throw std::invalid_argument("vocabulary training: " + error);
  std::vector<Descriptor> all;
  for (const auto& image : images) all.insert(all.end(), image.begin(), image.end());
  const bool differ = std::any_of(all.begin(), all.end(), [&](const Descriptor& d) { return d != all.front(); });
  if (!differ) throw std::invalid_argument("vocabulary training: the images have no features to learn from");

  VocabularyTree tree = GrowTree(std::move(all), options, progress);
  // Breadth-first growth gives the order that FromTree gives, so word i is the i-th leaf of tree.
  const Vocabulary unweighted = Vocabulary::FromTree(tree);
  std::vector<int> num_images(unweighted.NumWords(), 0);
  for (const auto& image : images) {
    for (const int32_t word : unweighted.Transform(image).bow.words) ++num_images[word];
  }
  std::vector<bool> is_inner(tree.parents.size(), false);
  for (size_t i = 1; i < tree.parents.size(); ++i) is_inner[tree.parents[i]] = true;
  int32_t word = 0;
  for (size_t i = 0; i < tree.parents.size(); ++i) {
    if (is_inner[i]) continue;
    const double share = static_cast<double>(images.size()) / std::max(1, num_images[word++]);
    tree.weights[i] = static_cast<float>(std::log(share));
  }
  return Vocabulary::FromTree(tree);
}

}  // namespace mapmend

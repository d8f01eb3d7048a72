#include "libs/retrieval/vocabulary.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>

namespace mapmend {
namespace {

// Digest of a sequence of 64-bit values: two lanes of multiply and rotate (the finaliser is MurmurHash3's). It tells
// vocabularies apart and finds damaged files; it is no protection against forgery.
class Digest {
 public:
  void Add(uint64_t value) {
    a_ = std::rotl((a_ ^ value) * 0x9e3779b97f4a7c15ull, 31);
    b_ = std::rotl((b_ + value) * 0xc2b2ae3d27d4eb4full, 29) ^ a_;
    ++count_;
  }
  std::string Hex() const {
    std::string hex;
    for (const uint64_t lane : {Mix(a_ ^ count_), Mix(b_ + count_)}) {
      for (int shift = 60; shift >= 0; shift -= 4) hex += "0123456789abcdef"[(lane >> shift) & 15];
    }
    return hex;
  }

 private:
  static uint64_t Mix(uint64_t h) {
    h = (h ^ (h >> 33)) * 0xff51afd7ed558ccdull;
    h = (h ^ (h >> 33)) * 0xc4ceb9fe1a85ec53ull;
    return h ^ (h >> 33);
  }
  uint64_t a_ = 0x6d61706d656e6421ull, b_ = 0x766f636162756c61ull, count_ = 0;
};

}  // namespace

Vocabulary Vocabulary::FromTree(const VocabularyTree& tree) {
  const int num_nodes = static_cast<int>(tree.descriptors.size());
  if (num_nodes < 2 || tree.parents.size() != tree.descriptors.size() ||
      tree.weights.size() != tree.descriptors.size()) {
    throw std::runtime_error("vocabulary: no nodes");
  }
  std::vector<std::vector<int32_t>> children(num_nodes);
  for (int i = 1; i < num_nodes; ++i) {
    const int32_t parent = tree.parents[i];
    if (parent < 0 || parent >= i)
      throw std::runtime_error("vocabulary: node " + std::to_string(i) + " stands before its parent");
    children[parent].push_back(i);
  }
  Vocabulary v;
  v.branching_factor_ = tree.branching_factor;
  v.num_levels_ = tree.num_levels;
  std::vector<int32_t> order = {0}, depth = {0};
  for (size_t i = 0; i < order.size(); ++i) {
    const int32_t node = order[i];
    const size_t num_children = children[node].size();
    if (num_children > 255 || static_cast<int>(num_children) > tree.branching_factor) {
      throw std::runtime_error("vocabulary: node " + std::to_string(node) +
                               " has more children than the branching factor");
    }
    if (depth[i] > tree.num_levels) throw std::runtime_error("vocabulary: deeper than its number of levels");
    v.descriptors_.push_back(i == 0 ? Descriptor{} : tree.descriptors[node]);
    v.num_children_.push_back(static_cast<uint8_t>(num_children));
    if (num_children == 0) {
      const float weight = tree.weights[node];
      if (!std::isfinite(weight) || weight < 0)
        throw std::runtime_error("vocabulary: bad weight of node " + std::to_string(node));
      v.weight_.push_back(weight);
    }
    order.insert(order.end(), children[node].begin(), children[node].end());
    depth.insert(depth.end(), num_children, depth[i] + 1);
  }
  v.Index();
  return v;
}

void Vocabulary::Index() {
  const size_t num_nodes = descriptors_.size();
  first_child_.resize(num_nodes);
  word_.resize(num_nodes);
  int32_t next_child = 1, next_word = 0;
  Digest digest;
  digest.Add(static_cast<uint64_t>(branching_factor_) << 32 | static_cast<uint64_t>(num_levels_));
  for (size_t i = 0; i < num_nodes; ++i) {
    first_child_[i] = next_child;
    next_child += num_children_[i];
    word_[i] = num_children_[i] == 0 ? next_word++ : -1;
    digest.Add(num_children_[i]);
    for (const uint64_t part : descriptors_[i]) digest.Add(part);
  }
  for (const float weight : weight_) digest.Add(std::bit_cast<uint32_t>(weight));
  num_words_ = next_word;
  hash_ = digest.Hex();
}

BowTransform Vocabulary::Transform(const Features& features, int levels_up) const {
  return Transform(features.descriptors, levels_up);
}

BowTransform Vocabulary::Transform(const std::vector<Descriptor>& descriptors, int levels_up) const {
  BowTransform result;
  result.words.reserve(descriptors.size());
  result.nodes.reserve(descriptors.size());
  const int node_depth = std::max(0, num_levels_ - levels_up);
  for (const Descriptor& descriptor : descriptors) {
    int32_t node = 0, kept_node = 0;
    for (int depth = 1; num_children_[node] > 0; ++depth) {
      const int32_t first = first_child_[node], end = first + num_children_[node];
      int best_distance = 257;
      for (int32_t child = first; child < end; ++child) {
        const int distance = HammingDistance(descriptor, descriptors_[child]);
        if (distance < best_distance) {
          best_distance = distance;
          node = child;
        }
      }
      if (depth <= node_depth) kept_node = node;
    }
    const int32_t word = word_[node];
    result.words.push_back(weight_[word] > 0 ? word : -1);
    result.nodes.push_back(kept_node);
  }

  std::vector<int32_t> sorted;
  sorted.reserve(result.words.size());
  for (const int32_t word : result.words) {
    if (word >= 0) sorted.push_back(word);
  }
  std::sort(sorted.begin(), sorted.end());
  double sum = 0;
  std::vector<double> weights;
  for (size_t i = 0; i < sorted.size();) {
    size_t end = i;
    while (end < sorted.size() && sorted[end] == sorted[i]) ++end;
    result.bow.words.push_back(sorted[i]);
    weights.push_back(static_cast<double>(end - i) * weight_[sorted[i]]);
    sum += weights.back();
    i = end;
  }
  for (const double weight : weights) result.bow.weights.push_back(static_cast<float>(weight / sum));
  return result;
}

int64_t Vocabulary::Bytes() const {
  return static_cast<int64_t>(descriptors_.capacity() * sizeof(Descriptor) + num_children_.capacity() +
                              (first_child_.capacity() + word_.capacity()) * sizeof(int32_t) +
                              weight_.capacity() * sizeof(float));
}

}  // namespace mapmend

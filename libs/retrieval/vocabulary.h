#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/features/features.h"
#include "libs/retrieval/bow_vector.h"

namespace mapmend {

// What the words of one image are: one entry per feature, and the BoW vector of all.
struct BowTransform {
  std::vector<int32_t> words;  // -1 for a word of weight 0 (seen in every training image)
  std::vector<int32_t> nodes;  // ancestor of the word, levels_up above it: features of like node are likely matches
  BowVector bow;
};

// A vocabulary as a plain tree, in any order in which parents stand before their children. Node 0 is the root; nodes
// without children are the words.
struct VocabularyTree {
  int branching_factor = 0, num_levels = 0;
  std::vector<Descriptor> descriptors;  // of the root: ignored
  std::vector<int32_t> parents;         // of the root: -1
  std::vector<float> weights;           // idf of the words, >= 0; of other nodes: ignored
};

// Hierarchical binary vocabulary (Galvez-Lopez and Tardos, T-RO 2012): a k-ary tree of 256-bit descriptors whose leaves
// are the words, with tf-idf weights and the L1 score. Immutable after loading; safe to share between threads.
class Vocabulary {
 public:
  // Reads the compact binary format (docs/file_formats.md) or DBoW2's text format, told apart by content. Throws
  // std::runtime_error with one line naming the file.
  static Vocabulary Read(const std::string& path);
  // Both throw std::runtime_error with one line naming the file; a file that was there is replaced only on success.
  void WriteBinary(const std::string& path) const;
  void WriteDbow2Text(const std::string& path) const;

  // Puts the nodes into the order used here: breadth first, brothers in the order given; words are numbered in that
  // order. So one tree has one form, and one hash, whatever file it came from. Throws std::runtime_error if it is not
  // such a tree.
  static Vocabulary FromTree(const VocabularyTree& tree);

  BowTransform Transform(const Features& features, int levels_up = 4) const;
  BowTransform Transform(const std::vector<Descriptor>& descriptors, int levels_up = 4) const;

  int NumWords() const { return num_words_; }
  int NumNodes() const { return static_cast<int>(descriptors_.size()); }
  int BranchingFactor() const { return branching_factor_; }
  int NumLevels() const { return num_levels_; }
  // Hex digest of tree and weights; the same whatever format it was read from.
  const std::string& Hash() const { return hash_; }
  // Heap memory held.
  int64_t Bytes() const;

 private:
  static Vocabulary ReadBinary(const std::string& path, const std::string& data);
  static Vocabulary ReadDbow2Text(const std::string& path, const std::string& data);
  // Fills first_child_, word_ and hash_ from num_children_, descriptors_ and weight_.
  void Index();

  int branching_factor_ = 0, num_levels_ = 0, num_words_ = 0;
  // Flat tree, breadth first, root = node 0; children of node i are first_child_[i] .. + num_children_[i], so that a
  // descent reads descriptors that lie side by side.
  std::vector<Descriptor> descriptors_;
  std::vector<uint8_t> num_children_;
  std::vector<int32_t> first_child_;
  std::vector<int32_t> word_;  // per node, -1 unless a leaf
  std::vector<float> weight_;  // per word, idf
  std::string hash_;
};

}  // namespace mapmend

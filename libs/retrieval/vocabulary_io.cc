#include <bit>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "libs/retrieval/vocabulary.h"

namespace mapmend {
namespace {

static_assert(std::endian::native == std::endian::little, "the binary format is little-endian");

constexpr char kMagic[8] = {'M', 'M', 'V', 'O', 'C', '\r', '\n', '\0'};
constexpr uint32_t kVersion = 1;

struct Header {
  char magic[8];
  uint32_t version;
  uint32_t branching_factor;
  uint32_t num_levels;
  uint32_t num_nodes;
  uint32_t num_words;
  char hash[32];
  uint32_t reserved;
};
static_assert(sizeof(Header) == 64);

[[noreturn]] void Fail(const std::string& path, const std::string& what) {
  throw std::runtime_error("vocabulary " + path + ": " + what);
}

template <typename T>
void AppendArray(const std::vector<T>& values, size_t first, std::string* data) {
  data->append(reinterpret_cast<const char*>(values.data() + first), (values.size() - first) * sizeof(T));
}

// Takes numbers off a line of text.
class Line {
 public:
  Line(const char* begin, const char* end) : at_(begin), end_(end) {}

  template <typename T>
  bool Take(T* value) {
    while (at_ < end_ && (*at_ == ' ' || *at_ == '\t')) ++at_;
    const auto [next, error] = std::from_chars(at_, end_, *value);
    if (error != std::errc()) return false;
    at_ = next;
    return true;
  }
  bool AtEnd() {
    while (at_ < end_ && (*at_ == ' ' || *at_ == '\t' || *at_ == '\r')) ++at_;
    return at_ == end_;
  }

 private:
  const char *at_, *end_;
};

}  // namespace

Vocabulary Vocabulary::Read(const std::string& path) {
  const std::string data = ReadFile(path);
  if (data.size() >= sizeof(kMagic) && std::memcmp(data.data(), kMagic, sizeof(kMagic)) == 0) {
    return ReadBinary(path, data);
  }
  return ReadDbow2Text(path, data);
}

Vocabulary Vocabulary::ReadBinary(const std::string& path, const std::string& data) {
  Header header;
  if (data.size() < sizeof(header)) Fail(path, "is truncated");
  std::memcpy(&header, data.data(), sizeof(header));
  if (header.version != kVersion)
    Fail(path, "has format version " + std::to_string(header.version) + ", this program reads 1");
  const uint64_t num_nodes = header.num_nodes, num_words = header.num_words;
  const uint64_t size = sizeof(header) + num_nodes + (num_nodes - 1) * sizeof(Descriptor) + num_words * sizeof(float);
  if (num_nodes < 2 || num_words >= num_nodes || header.branching_factor > 255 || header.num_levels > 32) {
    Fail(path, "has a damaged header");
  }
  if (data.size() != size) {
    Fail(path,
         "has " + std::to_string(data.size()) + " bytes instead of " + std::to_string(size) + ": truncated or damaged");
  }
  Vocabulary v;
  v.branching_factor_ = static_cast<int>(header.branching_factor);
  v.num_levels_ = static_cast<int>(header.num_levels);
  v.num_children_.resize(num_nodes);
  v.descriptors_.resize(num_nodes);
  v.weight_.resize(num_words);
  const char* at = data.data() + sizeof(header);
  std::memcpy(v.num_children_.data(), at, num_nodes);
  at += num_nodes;
  std::memcpy(v.descriptors_.data() + 1, at, (num_nodes - 1) * sizeof(Descriptor));
  at += (num_nodes - 1) * sizeof(Descriptor);
  std::memcpy(v.weight_.data(), at, num_words * sizeof(float));
  uint64_t num_children = 0, num_leaves = 0;
  for (size_t i = 0; i < num_nodes; ++i) {
    num_children += v.num_children_[i];
    num_leaves += v.num_children_[i] == 0;
    if (i + 1 < num_nodes && num_children <= i) Fail(path, "is damaged: its nodes do not form a tree");
  }
  if (num_children != num_nodes - 1 || num_leaves != num_words) Fail(path, "is damaged: its nodes do not form a tree");
  for (const float weight : v.weight_) {
    if (!std::isfinite(weight) || weight < 0) Fail(path, "is damaged: a weight is not a number");
  }
  v.Index();
  if (std::memcmp(v.hash_.data(), header.hash, sizeof(header.hash)) != 0)
    Fail(path, "is damaged: its digest does not match");
  return v;
}

void Vocabulary::WriteBinary(const std::string& path) const {
  Header header = {};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  header.version = kVersion;
  header.branching_factor = static_cast<uint32_t>(branching_factor_);
  header.num_levels = static_cast<uint32_t>(num_levels_);
  header.num_nodes = static_cast<uint32_t>(NumNodes());
  header.num_words = static_cast<uint32_t>(num_words_);
  std::memcpy(header.hash, hash_.data(), sizeof(header.hash));
  std::string data(reinterpret_cast<const char*>(&header), sizeof(header));
  AppendArray(num_children_, 0, &data);
  AppendArray(descriptors_, 1, &data);
  AppendArray(weight_, 0, &data);
  WriteFile(path, data);
}

// DBoW2's text format, as ORB-SLAM2 writes and reads it. First line: k L scoring weighting (0 0: L1 norm, tf-idf). Then
// a line per node from node 1 on: parent, 1 if a leaf, 32 bytes of the descriptor, weight.
Vocabulary Vocabulary::ReadDbow2Text(const std::string& path, const std::string& data) {
  VocabularyTree tree;
  std::vector<uint8_t> is_leaf;
  int line_number = 0;
  const char *at = data.data(), *end = at + data.size();
  while (at < end) {
    const char* newline = static_cast<const char*>(std::memchr(at, '\n', static_cast<size_t>(end - at)));
    const char* line_end = newline ? newline : end;
    Line line(at, line_end);
    at = line_end + 1;
    ++line_number;
    // An empty last line is no node (ORB-SLAM2's own loader makes one of it).
    if (line.AtEnd()) continue;
    if (tree.descriptors.empty()) {
      int scoring = -1, weighting = -1;
      if (!line.Take(&tree.branching_factor) || !line.Take(&tree.num_levels) || !line.Take(&scoring) ||
          !line.Take(&weighting) || !line.AtEnd() || tree.branching_factor < 2 || tree.branching_factor > 255 ||
          tree.num_levels < 1 || tree.num_levels > 32) {
        Fail(path, "is neither a mapmend vocabulary nor one in DBoW2's text format");
      }
      if (scoring != 0 || weighting != 0) Fail(path, "does not use the L1 score with tf-idf weights");
      tree.descriptors.emplace_back();
      tree.parents.push_back(-1);
      tree.weights.push_back(0);
      is_leaf.push_back(0);
      continue;
    }
    int32_t parent = -1;
    int leaf = -1;
    double weight = 0;
    uint8_t bytes[32];
    bool good = line.Take(&parent) && line.Take(&leaf);
    for (uint8_t& byte : bytes) good = good && line.Take(&byte);
    good = good && line.Take(&weight) && line.AtEnd();
    good = good && parent >= 0 && parent < static_cast<int32_t>(tree.parents.size()) && (leaf == 0 || leaf == 1);
    if (!good) Fail(path, "line " + std::to_string(line_number) + " is not a node: parent, leaf, 32 bytes, weight");
    Descriptor descriptor;
    std::memcpy(descriptor.data(), bytes, sizeof(bytes));
    tree.descriptors.push_back(descriptor);
    tree.parents.push_back(parent);
    tree.weights.push_back(static_cast<float>(weight));
    is_leaf.push_back(static_cast<uint8_t>(leaf));
  }
  std::vector<uint8_t> has_children(is_leaf.size(), 0);
  for (size_t i = 1; i < tree.parents.size(); ++i) has_children[tree.parents[i]] = 1;
  for (size_t i = 1; i < is_leaf.size(); ++i) {
    if (is_leaf[i] == has_children[i]) {
      Fail(path, "node " + std::to_string(i) +
                     (is_leaf[i] ? " is a leaf but has children" : " is no leaf but has no children"));
    }
  }
  try {
    return FromTree(tree);
  } catch (const std::runtime_error& e) {
    Fail(path, e.what());
  }
}

void Vocabulary::WriteDbow2Text(const std::string& path) const {
  std::vector<int32_t> parent(descriptors_.size(), 0);
  for (int32_t i = 0; i < NumNodes(); ++i) {
    for (int c = 0; c < num_children_[i]; ++c) parent[first_child_[i] + c] = i;
  }
  std::string text = std::to_string(branching_factor_) + " " + std::to_string(num_levels_) + " 0 0\n";
  char number[32];
  for (int32_t i = 1; i < NumNodes(); ++i) {
    text += std::to_string(parent[i]) + (num_children_[i] == 0 ? " 1" : " 0");
    uint8_t bytes[32];
    std::memcpy(bytes, descriptors_[i].data(), sizeof(bytes));
    for (const uint8_t byte : bytes) {
      text += ' ';
      text += std::to_string(byte);
    }
    // Nine digits give back the same float.
    std::snprintf(number, sizeof(number), " %.9g", word_[i] >= 0 ? weight_[word_[i]] : 0.0f);
    text += number;
    if (i + 1 < NumNodes()) text += '\n';  // none after the last: other loaders take it for a node
  }
  WriteFile(path, text);
}

}  // namespace mapmend

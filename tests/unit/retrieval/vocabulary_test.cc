#include "libs/retrieval/vocabulary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "libs/base/random.h"
#include "libs/retrieval/binary_kmeans.h"
#include "libs/retrieval/vocabulary_trainer.h"

namespace mapmend {
namespace vocabulary_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr uint64_t kOnes = ~uint64_t{0};

// Two levels. Node 1 (all zeros) has leaves 3 (zeros) and 4 (first word ones); node 2 (all ones) is a leaf.
VocabularyTree SmallTree() {
  VocabularyTree tree;
  tree.branching_factor = 2;
  tree.num_levels = 2;
  tree.descriptors = {{}, {0, 0, 0, 0}, {kOnes, kOnes, kOnes, kOnes}, {0, 0, 0, 0}, {kOnes, 0, 0, 0}};
  tree.parents = {-1, 0, 0, 1, 1};
  tree.weights = {0, 0, 3.0f, 0.1f, 1.0f / 3};
  return tree;
}

class VocabularyFile : public testing::Test {
 protected:
  VocabularyFile() {
    directory_ = std::filesystem::temp_directory_path() / ("mapmend_vocabulary_test." + std::to_string(getpid()));
    std::filesystem::create_directories(directory_);
  }
  ~VocabularyFile() override { std::filesystem::remove_all(directory_); }
  std::string Path(const std::string& name) const { return (directory_ / name).string(); }
  std::string Write(const std::string& name, const std::string& content) const {
    std::ofstream(Path(name), std::ios::binary) << content;
    return Path(name);
  }
  static std::string Content(const std::string& path) {
    std::stringstream content;
    content << std::ifstream(path, std::ios::binary).rdbuf();
    return content.str();
  }
  static std::string ErrorOfReading(const std::string& path) {
    try {
      Vocabulary::Read(path);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "no error";
  }
  std::filesystem::path directory_;
};

std::vector<std::vector<Descriptor>> RandomImages(int num_images, int num_features) {
  Random random(11);
  std::vector<Descriptor> things;
  for (int i = 0; i < 200; ++i) things.push_back({random.Next(), random.Next(), random.Next(), random.Next()});
  std::vector<std::vector<Descriptor>> images(num_images);
  for (auto& image : images) {
    for (int i = 0; i < num_features; ++i) {
      Descriptor d = things[random.Next() % things.size()];
      for (int flip = 0; flip < 16; ++flip) d[random.Next() % 4] ^= uint64_t{1} << (random.Next() % 64);
      image.push_back(d);
    }
  }
  return images;
}

TEST(Vocabulary, DescendsToTheNearestLeaf) {
  const Vocabulary v = Vocabulary::FromTree(SmallTree());
  EXPECT_EQ(v.NumNodes(), 5);
  EXPECT_EQ(v.NumWords(), 3);  // in breadth-first order: node 2, 3, 4
  const std::vector<Descriptor> descriptors = {
      {kOnes, kOnes, kOnes, 0}, {1, 0, 0, 0}, {kOnes, 0, 0, 1}, {kOnes, 0, 0, 0}, {kOnes, kOnes, 0, 0}};
  const BowTransform t = v.Transform(descriptors, 1);
  EXPECT_THAT(t.words, ElementsAre(0, 1, 2, 2, 2));  // the last one ties at the first level: first child
  EXPECT_THAT(t.nodes, ElementsAre(2, 1, 1, 1, 1));
  // tf-idf: 3, 0.1 and three times 1/3, divided by their sum 4.1.
  EXPECT_THAT(t.bow.words, ElementsAre(0, 1, 2));
  EXPECT_FLOAT_EQ(t.bow.weights[0], 3 / 4.1f);
  EXPECT_FLOAT_EQ(t.bow.weights[1], 0.1f / 4.1f);
  EXPECT_FLOAT_EQ(t.bow.weights[2], 1 / 4.1f);
  EXPECT_THAT(v.Transform(descriptors, 0).nodes, ElementsAre(2, 3, 4, 4, 4));
  EXPECT_THAT(v.Transform(descriptors, 9).nodes, ElementsAre(0, 0, 0, 0, 0));
  EXPECT_EQ(v.Transform(std::vector<Descriptor>()).bow.Size(), 0);
}

TEST(Vocabulary, WordsOfWeightZeroDoNotCount) {
  VocabularyTree tree = SmallTree();
  tree.weights[2] = 0;
  const BowTransform t = Vocabulary::FromTree(tree).Transform({{kOnes, kOnes, kOnes, kOnes}, {0, 0, 0, 0}}, 1);
  EXPECT_THAT(t.words, ElementsAre(-1, 1));
  EXPECT_THAT(t.nodes, ElementsAre(2, 1));
  EXPECT_THAT(t.bow.words, ElementsAre(1));
  EXPECT_FLOAT_EQ(t.bow.weights[0], 1);
}

TEST(Vocabulary, OneTreeHasOneForm) {
  // The same tree, depth first.
  VocabularyTree tree;
  tree.branching_factor = 2;
  tree.num_levels = 2;
  tree.descriptors = {{}, {0, 0, 0, 0}, {0, 0, 0, 0}, {kOnes, 0, 0, 0}, {kOnes, kOnes, kOnes, kOnes}};
  tree.parents = {-1, 0, 1, 1, 0};
  tree.weights = {0, 0, 0.1f, 1.0f / 3, 3.0f};
  const Vocabulary a = Vocabulary::FromTree(SmallTree());
  EXPECT_EQ(Vocabulary::FromTree(tree).Hash(), a.Hash());
  EXPECT_EQ(a.Hash().size(), 32u);
  tree.weights[4] = 2.0f;
  EXPECT_NE(Vocabulary::FromTree(tree).Hash(), a.Hash());
  tree.weights[4] = 3.0f;
  tree.descriptors[3][1] ^= 1;
  EXPECT_NE(Vocabulary::FromTree(tree).Hash(), a.Hash());
}

TEST(Vocabulary, RefusesWhatIsNoTree) {
  VocabularyTree tree = SmallTree();
  tree.parents[1] = 3;
  EXPECT_THROW(Vocabulary::FromTree(tree), std::runtime_error);
  tree = SmallTree();
  tree.parents[4] = 0;  // three children of a binary tree
  EXPECT_THROW(Vocabulary::FromTree(tree), std::runtime_error);
  tree = SmallTree();
  tree.num_levels = 1;
  EXPECT_THROW(Vocabulary::FromTree(tree), std::runtime_error);
  tree = SmallTree();
  tree.weights[3] = NAN;
  EXPECT_THROW(Vocabulary::FromTree(tree), std::runtime_error);
  EXPECT_THROW(Vocabulary::FromTree({}), std::runtime_error);
}

TEST_F(VocabularyFile, BothFormatsGiveTheSameVocabulary) {
  VocabularyTrainerOptions options;
  options.num_levels = 3;
  const auto images = RandomImages(12, 150);
  const Vocabulary trained = TrainVocabulary(images, options);
  trained.WriteBinary(Path("a.voc"));
  trained.WriteDbow2Text(Path("a.txt"));
  const Vocabulary binary = Vocabulary::Read(Path("a.voc")), text = Vocabulary::Read(Path("a.txt"));
  EXPECT_EQ(binary.Hash(), trained.Hash());
  EXPECT_EQ(text.Hash(), trained.Hash());
  EXPECT_EQ(text.NumNodes(), trained.NumNodes());
  EXPECT_EQ(text.NumLevels(), 3);
  const BowTransform a = trained.Transform(images[3]), b = binary.Transform(images[3]), c = text.Transform(images[3]);
  EXPECT_EQ(a.words, b.words);
  EXPECT_EQ(a.nodes, c.nodes);
  EXPECT_EQ(a.bow.weights, b.bow.weights);
  EXPECT_EQ(a.bow.weights, c.bow.weights);
  text.WriteBinary(Path("b.voc"));
  EXPECT_EQ(Content(Path("a.voc")), Content(Path("b.voc")));
}

TEST_F(VocabularyFile, ReadsDbow2TextWithAndWithoutTrailingNewline) {
  const auto node = [](int parent, int leaf, int byte, const std::string& weight) {
    std::stringstream line;
    line << parent << " " << leaf << " " << byte;
    for (int i = 1; i < 32; ++i) line << " 0";
    line << " " << weight;
    return line.str();
  };
  const std::string text = "10 6  0 0\n" + node(0, 1, 7, "0.5") + "\n" + node(0, 0, 255, "0") + "\n" +
                           node(2, 1, 254, "1.5") + "\n" + node(2, 1, 128, "2.5");
  const Vocabulary plain = Vocabulary::Read(Write("plain.txt", text));
  EXPECT_EQ(plain.NumNodes(), 5);
  EXPECT_EQ(plain.NumWords(), 3);
  EXPECT_EQ(plain.BranchingFactor(), 10);
  EXPECT_EQ(plain.NumLevels(), 6);
  for (const char* ending : {"\n", "\n\n", "\r\n", " \n"}) {
    EXPECT_EQ(Vocabulary::Read(Write("ending.txt", text + ending)).Hash(), plain.Hash());
  }
  const BowTransform t = plain.Transform({Descriptor{128, 0, 0, 0}}, 5);
  EXPECT_THAT(t.words, ElementsAre(0));  // 4 bits to 7, 7 bits to 255
  plain.WriteDbow2Text(Path("written.txt"));
  EXPECT_NE(Content(Path("written.txt")).back(), '\n');
}

TEST_F(VocabularyFile, NamesWhatIsWrong) {
  EXPECT_THAT(ErrorOfReading(Path("absent.voc")), HasSubstr("absent.voc"));
  EXPECT_THAT(ErrorOfReading(directory_.string()), HasSubstr("directory"));
  EXPECT_THAT(ErrorOfReading(Write("empty", "")), HasSubstr("empty: "));
  EXPECT_THAT(ErrorOfReading(Write("foreign", "PNG")), HasSubstr("neither"));
  EXPECT_THAT(ErrorOfReading(Write("cosine.txt", "10 6 5 0\n")), HasSubstr("L1"));
  EXPECT_THAT(ErrorOfReading(Write("short.txt", "10 6 0 0\n0 1 3 4\n")), HasSubstr("line 2"));

  Vocabulary::FromTree(SmallTree()).WriteBinary(Path("good.voc"));
  const std::string good = Content(Path("good.voc"));
  EXPECT_EQ(good.size(), 64u + 5 + 4 * 32 + 3 * 4);
  EXPECT_THAT(ErrorOfReading(Write("cut.voc", good.substr(0, good.size() - 1))), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOfReading(Write("head.voc", good.substr(0, 20))), HasSubstr("truncated"));
  for (const size_t at :
       {size_t{16}, size_t{20}, size_t{24}, size_t{40}, size_t{64}, size_t{66}, size_t{80}, good.size() - 1}) {
    std::string damaged = good;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x41);
    EXPECT_NE(ErrorOfReading(Write("damaged.voc", damaged)), "no error") << at;
  }
  std::string newer = good;
  newer[8] = 2;
  EXPECT_THAT(ErrorOfReading(Write("newer.voc", newer)), HasSubstr("version 2"));
  EXPECT_THROW(Vocabulary::FromTree(SmallTree()).WriteBinary(Path("absent/good.voc")), std::runtime_error);
}

TEST(TrainVocabulary, WeightsAreTheIdf) {
  // Thing A is in all four images, B in two, C in one.
  const Descriptor a = {kOnes, 0, 0, 0}, b = {0, kOnes, 0, 0}, c = {0, 0, kOnes, kOnes};
  const std::vector<std::vector<Descriptor>> images = {{a, b, b, c}, {a, b}, {a}, {a, a}};
  VocabularyTrainerOptions options;
  options.branching_factor = 3;
  options.num_levels = 1;
  const Vocabulary v = TrainVocabulary(images, options);
  EXPECT_EQ(v.NumWords(), 3);
  const BowTransform t = v.Transform(images[0]);
  EXPECT_EQ(t.words[0], -1);  // ln(4 / 4) = 0
  EXPECT_EQ(t.words[1], t.words[2]);
  // b twice ln(4/2), c once ln(4/1): equal weights.
  ASSERT_EQ(t.bow.Size(), 2);
  EXPECT_FLOAT_EQ(t.bow.weights[0], 0.5f);
  EXPECT_FLOAT_EQ(t.bow.weights[1], 0.5f);
}

TEST(TrainVocabulary, IsReproducibleAndBounded) {
  const auto images = RandomImages(10, 200);
  VocabularyTrainerOptions options;
  options.branching_factor = 5;
  options.num_levels = 3;
  double last = 0;
  const Vocabulary v = TrainVocabulary(images, options, [&](double share) {
    EXPECT_GE(share, last);
    last = share;
  });
  EXPECT_GT(last, 0.5);
  EXPECT_LE(last, 1.0);
  EXPECT_EQ(TrainVocabulary(images, options).Hash(), v.Hash());
  EXPECT_LE(v.NumWords(), 125);
  EXPECT_GT(v.NumWords(), 100);
  options.seed = 2;
  EXPECT_NE(TrainVocabulary(images, options).Hash(), v.Hash());
}

TEST(TrainVocabulary, LikeImagesScoreHigher) {
  const auto images = RandomImages(10, 200);
  VocabularyTrainerOptions options;
  options.num_levels = 3;
  const Vocabulary v = TrainVocabulary(images, options);
  // A noisy copy of image 0.
  Random random(4);
  std::vector<Descriptor> copy = images[0];
  for (Descriptor& d : copy) d[random.Next() % 4] ^= uint64_t{1} << (random.Next() % 64);
  const BowVector query = v.Transform(copy).bow;
  for (int i = 1; i < 10; ++i) {
    EXPECT_GT(BowScore(query, v.Transform(images[0]).bow), BowScore(query, v.Transform(images[i]).bow));
  }
}

TEST(TrainVocabulary, RefusesNothingToLearnFrom) {
  EXPECT_THROW(TrainVocabulary({}, {}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary({{{1}, {1}}}, {}), std::invalid_argument);
  VocabularyTrainerOptions options;
  options.branching_factor = 1;
  EXPECT_THROW(TrainVocabulary(RandomImages(2, 20), options), std::invalid_argument);
}

}  // namespace vocabulary_test
}  // namespace mapmend

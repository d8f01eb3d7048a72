#include "libs/base/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "libs/base/options_file.h"

namespace mapmend {
namespace options_test {

using testing::ElementsAre;
using testing::HasSubstr;

struct SearchOptions {
  int max_results = 20;
  double radius = 4;
  double confidence = 0.99;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_results", max_results, Range(1, 100));
    v("radius", radius, MoreThan(0), "pixels");
    v("confidence", confidence, Between(0, 1));
  }
  std::string Conflict() const { return radius > max_results ? "radius must not be more than max_results" : ""; }
};

struct TrackerLikeOptions {
  SearchOptions near, far;
  bool is_fast = true;
  std::string name = "first";
  int64_t bytes = 8 << 20;
  double end = std::numeric_limits<double>::infinity();
  std::vector<double> radii = {16, 8.5};
  std::vector<int> rounds = {3, 2};
  uint64_t seed = 1;
  std::optional<uint64_t> other_seed;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("near", near);
    v("far", far);
    v("is_fast", is_fast);
    v("name", name);
    v("bytes", bytes, Range(1, 1e12), "bytes");
    v("end", end, AtLeast(0), "s");
    v("radii", radii, MoreThan(0));
    v("rounds", rounds, Range(1, 9));
    v("seed", seed);
    v("other_seed", other_seed);
  }
};

class OptionsTest : public testing::Test {
 protected:
  // What Set throws; empty if it does not.
  std::string ErrorOf(const std::string& name, const std::string& text) {
    try {
      list_.Set(name, text);
    } catch (const OptionError& e) {
      return e.what();
    }
    return "";
  }

  TrackerLikeOptions options_, defaults_;
  OptionList list_ = OptionList::Of(options_);
  OptionList usual_ = OptionList::Of(defaults_);
};

TEST_F(OptionsTest, NamesAreDottedAndInOrder) {
  std::vector<std::string> names;
  for (const Option& option : list_.options()) names.push_back(option.name);
  EXPECT_THAT(
      names, ElementsAre("near.max_results", "near.radius", "near.confidence", "far.max_results", "far.radius",
                         "far.confidence", "is_fast", "name", "bytes", "end", "radii", "rounds", "seed", "other_seed"));
}

TEST_F(OptionsTest, EveryKindIsSetAndToldAgain) {
  const std::vector<std::pair<std::string, std::string>> values = {
      {"near.max_results", "30"},       {"far.radius", "0.125"}, {"is_fast", "false"}, {"name", "a, b"},
      {"bytes", "5000000000"},          {"end", "2.5"},          {"radii", "1, 0.5"},  {"rounds", "9"},
      {"seed", "18446744073709551615"}, {"other_seed", "7"}};
  for (const auto& [name, text] : values) {
    list_.Set(name, text);
    EXPECT_EQ(list_.Find(name)->Text(), text) << name;
  }
  EXPECT_EQ(options_.near.max_results, 30);
  EXPECT_EQ(options_.far.max_results, 20);
  EXPECT_EQ(options_.far.radius, 0.125);
  EXPECT_FALSE(options_.is_fast);
  EXPECT_EQ(options_.bytes, 5000000000);
  EXPECT_THAT(options_.radii, ElementsAre(1, 0.5));
  EXPECT_THAT(options_.rounds, ElementsAre(9));
  EXPECT_EQ(options_.seed, std::numeric_limits<uint64_t>::max());
  EXPECT_EQ(options_.other_seed, 7u);
  list_.Set("other_seed", "none");
  EXPECT_FALSE(options_.other_seed);
  list_.Set("end", "inf");
  EXPECT_TRUE(std::isinf(options_.end));
  list_.Set("radii", " [4,2 , 1] ");
  EXPECT_THAT(options_.radii, ElementsAre(4, 2, 1));
}

TEST_F(OptionsTest, ABadValueIsToldInOneLineAndChangesNothing) {
  EXPECT_EQ(ErrorOf("near.max_results", "many"), "near.max_results = many: 'many' is not a whole number");
  EXPECT_EQ(ErrorOf("near.max_results", "3.5"), "near.max_results = 3.5: '3.5' is not a whole number");
  EXPECT_EQ(ErrorOf("near.max_results", "101"), "near.max_results = 101: must lie in 1 to 100");
  EXPECT_EQ(ErrorOf("near.max_results", "9999999999"),
            "near.max_results = 9999999999: '9999999999' is too large a number");
  EXPECT_EQ(ErrorOf("near.radius", "0"), "near.radius = 0: must be more than 0");
  EXPECT_EQ(ErrorOf("near.radius", "nan"), "near.radius = nan: must be more than 0");
  EXPECT_EQ(ErrorOf("near.radius", ""), "near.radius = : '' is not a number");
  EXPECT_EQ(ErrorOf("near.confidence", "1"), "near.confidence = 1: must be more than 0, less than 1");
  EXPECT_EQ(ErrorOf("is_fast", "1"), "is_fast = 1: '1' is neither true nor false");
  EXPECT_EQ(ErrorOf("rounds", "3, 10"), "rounds = 3, 10: each must lie in 1 to 9");
  EXPECT_EQ(ErrorOf("rounds", "3, x"), "rounds = 3, x: 'x' is not a whole number");
  EXPECT_EQ(ErrorOf("seed", "-1"), "seed = -1: '-1' is not a whole number");
  EXPECT_EQ(ToJson(list_), ToJson(usual_));
}

TEST_F(OptionsTest, AnUnknownNameIsToldWithTheNearestOnes) {
  EXPECT_EQ(ErrorOf("near.max_result", "3"), "near.max_result: no such option; did you mean near.max_results?");
  EXPECT_EQ(ErrorOf("radius", "3"), "radius: no such option; did you mean near.radius or far.radius?");
  EXPECT_EQ(ErrorOf("confidense", "3"), "confidense: no such option; did you mean near.confidence or far.confidence?");
  EXPECT_EQ(ErrorOf("weather", "3"), "weather: no such option");
  EXPECT_EQ(ErrorOf("near", "3"), "near: is a group of options, such as near.max_results");
  EXPECT_EQ(ErrorOf("", "3"), ": no such option");
}

TEST_F(OptionsTest, CheckNamesTheFirstProblemThenWhatDoesNotGoTogether) {
  EXPECT_EQ(CheckOptions(options_), "");
  options_.far.radius = 21;
  EXPECT_EQ(CheckOptions(options_), "far: radius must not be more than max_results");
  options_.far.confidence = 2;
  EXPECT_EQ(CheckOptions(options_), "far.confidence = 2: must be more than 0, less than 1");
  options_.near.max_results = 0;
  EXPECT_EQ(CheckOptions(options_), "near.max_results = 0: must lie in 1 to 100");
}

TEST_F(OptionsTest, ChangesAreWhatDiffersFromTheDefaults) {
  EXPECT_EQ(ChangesToJson(list_, usual_), "{}");
  options_.near.radius = 0.1;
  options_.radii = {2};
  options_.other_seed = 3;
  options_.end = 1;
  EXPECT_EQ(ChangesToJson(list_, usual_), R"({"near.radius":0.1,"end":1.0,"radii":[2.0],"other_seed":3})");
}

TEST_F(OptionsTest, JsonHoldsEveryOption) {
  EXPECT_EQ(ToJson(list_),
            R"({"near.max_results":20,"near.radius":4.0,"near.confidence":0.99,"far.max_results":20,"far.radius":4.0,)"
            R"("far.confidence":0.99,"is_fast":true,"name":"first","bytes":8388608,"end":"inf","radii":[16.0,8.5],)"
            R"("rounds":[3,2],"seed":1,"other_seed":null})");
}

class OptionsFileTest : public OptionsTest {
 protected:
  void SetUp() override {
    std::string path = (std::filesystem::temp_directory_path() / "options-XXXXXX").string();
    ASSERT_NE(mkdtemp(path.data()), nullptr);
    folder_ = path;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& text) {
    const std::string path = folder_ + "/options.yaml";
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  // Without the path at its beginning.
  std::string ReadError(const std::string& text) {
    const std::string path = Write(text);
    try {
      ReadOptionsFile(path);
    } catch (const OptionError& e) {
      const std::string line = e.what();
      EXPECT_TRUE(line.starts_with(path + ":")) << line;
      EXPECT_EQ(line.find('\n'), std::string::npos) << line;
      return line.substr(std::min(line.size(), path.size() + 1));
    }
    return "";
  }

  std::string folder_;
};

TEST_F(OptionsFileTest, WhatIsPrintedIsReadAgain) {
  options_.near.radius = 1.0 / 3;
  options_.name = "with \"quotes\": and # signs";
  options_.radii = {};
  options_.other_seed = 12;
  options_.is_fast = false;
  TrackerLikeOptions read;
  const OptionList read_list = OptionList::Of(read);
  const std::vector<OptionLine> lines = ReadOptionsFile(Write(ToYaml(list_, usual_, "")));
  ASSERT_EQ(lines.size(), list_.options().size());
  for (const OptionLine& line : lines) read_list.Set(line.name, line.text);
  EXPECT_EQ(ToJson(read_list), ToJson(list_));
}

TEST_F(OptionsFileTest, PrintedOptionsTellRangeUnitAndDefault) {
  options_.near.radius = 5;
  const std::string yaml = ToYaml(list_, usual_, "tracker");
  EXPECT_THAT(yaml, HasSubstr("tracker:\n  near:\n    max_results: 20                     # 1 to 100\n"));
  EXPECT_THAT(yaml, HasSubstr("    radius: 5                           # more than 0; pixels; default 4\n"));
  EXPECT_THAT(ToMarkdown(usual_, "tracker"), HasSubstr("| tracker.near.radius | 4 | more than 0 | pixels |\n"));
}

TEST_F(OptionsFileTest, GroupsAndDottedNamesMayBeMixed) {
  const std::vector<OptionLine> lines = ReadOptionsFile(
      Write("# mine\nnear:\n  radius: 3\nfar.radius: 2\nradii: [4, 2]\nrounds:\n  - 1\n  - 2\nempty:\n"));
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(lines[0].name, "near.radius");
  EXPECT_EQ(lines[0].text, "3");
  EXPECT_EQ(lines[0].line, 3);
  EXPECT_EQ(lines[1].name, "far.radius");
  EXPECT_EQ(lines[2].text, "4, 2");
  EXPECT_EQ(lines[3].text, "1, 2");
  EXPECT_TRUE(lines[4].is_empty);
  EXPECT_TRUE(ReadOptionsFile(Write("")).empty());
}

TEST_F(OptionsFileTest, WhatIsNoSuchFileIsToldWithItsLine) {
  EXPECT_EQ(ReadError("near:\n  radius: 3\nnear.radius: 4\n"), "3: near.radius: is there twice");
  EXPECT_EQ(ReadError("near:\n  radius: 3\n  radius: 4\n"), "3: near.radius: is there twice");
  EXPECT_EQ(ReadError("- 3\n- 4\n"), "1: expected options, such as 'tracker.min_inliers: 30'");
  EXPECT_EQ(ReadError("a: 1\nradii: [[1, 2]]\n"), "2: radii: expected values in one list");
  EXPECT_THAT(ReadError("near:\n  radius: [3\n"), HasSubstr(": "));
  try {
    ReadOptionsFile(folder_ + "/none.yaml");
    FAIL();
  } catch (const OptionError& e) {
    EXPECT_EQ(e.what(), folder_ + "/none.yaml: cannot be read");
  }
}

}  // namespace options_test
}  // namespace mapmend

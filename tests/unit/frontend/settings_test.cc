// What a session tells about how it was made, and the name that follows from it.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "libs/base/options.h"
#include "procs/frontend/run_options.h"

namespace mapmend {
namespace settings_test {

// Gives an option another value that it may have.
void Change(const Option& option) {
  const std::string before = option.Text();
  std::vector<std::string> candidates = {"true", "false", "7", "3", "2", "1", "0.5", "0.25", "5000", "other"};
  if (option.range && std::isfinite(option.range->hi)) {
    const double middle = (option.range->lo + option.range->hi) / 2;
    candidates.insert(candidates.begin(), {std::to_string(std::llround(middle)), std::to_string(middle)});
  }
  for (const std::string& candidate : candidates) {
    if (option.Set(candidate).empty() && option.Text() != before) return;
  }
  FAIL() << option.name << ": no other value found";
}

class SettingsTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string path = (std::filesystem::temp_directory_path() / "settings-XXXXXX").string();
    ASSERT_NE(mkdtemp(path.data()), nullptr);
    folder_ = path;
    std::ofstream(folder_ + "/input.png") << "not looked into";
    defaults_.inputs = {folder_ + "/input.png"};
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string folder_;
  RunOptions defaults_;
};

TEST_F(SettingsTest, WithoutChangesTheyAreThoseOfTheFirstVersion) {
  EXPECT_EQ(ToJson(defaults_),
            R"({"bundle_keyframes":12,"keyframe_ratio":0.7,"max_dimension":0,"max_lost_frames":3,"min_inliers":25,)"
            R"("num_features":0,"relocalisation_frames":10,"seed":1,"skip_frames":""})");
}

TEST_F(SettingsTest, AnyOptionThatMayChangeTheStreamChangesThemAndTheSession) {
  const std::string settings = ToJson(defaults_), session = SessionForFile(defaults_);
  const size_t num_options = OptionList::Of(defaults_).options().size();
  ASSERT_GT(num_options, 90u);
  std::set<std::string> all_settings = {settings}, all_sessions = {session}, unchanged;
  for (size_t i = 0; i < num_options; ++i) {
    RunOptions changed = defaults_;
    const OptionList list = OptionList::Of(changed);
    const Option& option = list.options()[i];
    Change(option);
    if (!ChangesStream(option.name)) {
      EXPECT_EQ(ToJson(changed), settings) << option.name;
      EXPECT_EQ(SessionForFile(changed), session) << option.name;
      unchanged.insert(option.name.substr(0, option.name.find('.')));
      continue;
    }
    EXPECT_TRUE(all_settings.insert(ToJson(changed)).second) << option.name;
    EXPECT_TRUE(all_sessions.insert(SessionForFile(changed)).second) << option.name;
  }
  EXPECT_EQ(unchanged, (std::set<std::string>{"sender", "deliver_timeout_s", "images"}));
}

TEST_F(SettingsTest, AnOptionSetToItsDefaultIsNoChange) {
  RunOptions options = defaults_;
  OptionList::Of(options).Set("tracker.pnp.confidence", "0.999");
  EXPECT_EQ(ToJson(options), ToJson(defaults_));
}

TEST_F(SettingsTest, ChangesStandUnderTheirNames) {
  RunOptions options = defaults_;
  const OptionList list = OptionList::Of(options);
  list.Set("tracker.min_spread", "0.125");
  list.Set("orb.num_levels", "6");
  list.Set("tracker.min_inliers", "30");  // has a name of its own since the first version
  const nlohmann::json settings = nlohmann::json::parse(ToJson(options));
  EXPECT_EQ(settings["options"], nlohmann::json::parse(R"({"orb.num_levels": 6, "tracker.min_spread": 0.125})"));
  EXPECT_EQ(settings["min_inliers"], 30);
}

TEST_F(SettingsTest, DefaultsAreWithinTheirRanges) { EXPECT_EQ(CheckOptions(RunOptions()), ""); }

}  // namespace settings_test
}  // namespace mapmend

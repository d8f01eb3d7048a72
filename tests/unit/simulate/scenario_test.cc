#include "tools/simulate/scenario.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace mapmend::simulate {
namespace scenario_test {

using ::testing::HasSubstr;

const std::string kFolder = std::string(MAPMEND_SOURCE_DIR) + "/data/scenarios";

class ScenarioFile : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = std::filesystem::temp_directory_path() / ("mapmend_scenario_" + std::to_string(getpid()) + ".yaml");
  }
  void TearDown() override { std::filesystem::remove(path_); }
  // The one line that reading this text ends with; empty if it is accepted.
  std::string Error(const std::string& text) {
    std::ofstream(path_) << text;
    try {
      ReadScenario(path_.string(), kFolder);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }
  std::filesystem::path path_;
};

TEST_F(ScenarioFile, SaysOnlyWhatDiffersFromItsBase) {
  EXPECT_EQ(Error("base: uav_short\nframes: 7\ncamera: {fx: 300}\nevents: []\n"), "");
  const Scenario scenario = ReadScenario(path_.string(), kFolder), base = ReadScenario("uav_short", kFolder);
  EXPECT_EQ(scenario.frames, 7);
  EXPECT_EQ(scenario.camera.fx, 300);
  EXPECT_EQ(scenario.camera.fy, 300);
  EXPECT_EQ(scenario.camera.width, base.camera.width);
  EXPECT_EQ(scenario.trajectory.strips, base.trajectory.strips);
  EXPECT_EQ(base.events.size(), 3u);
  EXPECT_TRUE(scenario.events.empty());
}

TEST_F(ScenarioFile, NamesWhatIsUnknown) {
  EXPECT_THAT(Error("base: uav_short\nframez: 7\n"), HasSubstr("framez is not known"));
  EXPECT_THAT(Error("base: uav_short\ncamera: {focal: 7}\n"), HasSubstr("camera.focal is not known"));
  EXPECT_THAT(Error("base: uav_short\nevents: [{kind: storm}]\n"), HasSubstr("\"storm\"; known are gust"));
  EXPECT_THAT(Error("base: nothing_like_it\n"), HasSubstr("nothing_like_it is not known; known are"));
  EXPECT_THAT(Error("base: [\n"), HasSubstr("is not YAML"));
}

TEST_F(ScenarioFile, RefusesTheImpossible) {
  EXPECT_THAT(Error("base: uav_short\ntrajectory: {start: [0, 0, -5]}\n"),
              HasSubstr("trajectory.start: the height must be positive"));
  EXPECT_THAT(Error("base: uav_short\ncamera: {fx: 0}\n"), HasSubstr("focal length"));
  EXPECT_THAT(Error("base: uav_short\ncamera: {width: 961}\n"), HasSubstr("even"));
  EXPECT_THAT(Error("base: uav_short\nfps: -1\n"), HasSubstr("fps"));
  EXPECT_THAT(Error("base: uav_short\nfps: fast\n"), HasSubstr("key fps must be a number"));
  EXPECT_THAT(Error("base: uav_short\nfps: .nan\n"), HasSubstr("fps must be finite"));
  EXPECT_THAT(Error("base: uav_short\nsensor: {exposure_ms: 900}\n"), HasSubstr("exposure_ms"));
  EXPECT_THAT(Error("base: uav_short\nsensor: {sharpening: -1}\n"), HasSubstr("sharpening"));
  EXPECT_THAT(Error("base: uav_short\nsensor: {noise: -1}\n"), HasSubstr("noise"));
  EXPECT_THAT(Error("base: uav_short\ncamera: {fx: 0}\n"), HasSubstr("focal"));
  EXPECT_THAT(Error("base: uav_short\nscene: {width: 90000, length: 90000}\n"), HasSubstr("too large"));
  EXPECT_THAT(Error("base: street_short\ntrajectory: {points: [{at: [0, 0, -1]}]}\n"), HasSubstr("height"));
}

TEST_F(ScenarioFile, ADropStaysAboveTheLowestHeightFlown) {
  EXPECT_EQ(Error("base: office_short\nevents: [{kind: drop, at: 3, duration: 1}]\n"), "");
  Scenario scenario = ReadScenario(path_.string(), kFolder);
  PlaceRandomEvents(&scenario);
  ASSERT_EQ(scenario.events.size(), 1u);
  for (const Waypoint& point : scenario.trajectory.points) EXPECT_LT(scenario.events[0].amount, point.position.z());
}

TEST(Scenario, AllThatAreShippedCanBeRead) {
  const auto list = ListScenarios(kFolder);
  EXPECT_GE(list.size(), 20u);
  for (const auto& [name, description] : list) {
    Scenario scenario = ReadScenario(name, kFolder);
    EXPECT_FALSE(description.empty()) << name;
    PlaceRandomEvents(&scenario);
    for (const Event& event : scenario.events) {
      EXPECT_LT(event.at + event.duration, scenario.frames / scenario.fps) << name;
    }
    if (name.ends_with("_uninterrupted")) {
      EXPECT_TRUE(scenario.events.empty()) << name;
      EXPECT_EQ(scenario.frames, ReadScenario(name.substr(0, name.size() - 14), kFolder).frames);
    }
  }
}

TEST(Scenario, RandomEventsDependOnTheSeedAndKeepApart) {
  Scenario a = ReadScenario("office", kFolder), b = a, c = a;
  c.seed = a.seed + 1;
  PlaceRandomEvents(&a);
  PlaceRandomEvents(&b);
  PlaceRandomEvents(&c);
  ASSERT_EQ(a.events.size(), 14u);
  EXPECT_EQ(a.events[3].at, b.events[3].at);
  EXPECT_NE(a.events[3].at, c.events[3].at);
  for (size_t i = 1; i < a.events.size(); ++i) {
    EXPECT_GE(a.events[i].at - a.events[i - 1].at - a.events[i - 1].duration, a.random_events.margin);
  }
}

}  // namespace scenario_test
}  // namespace mapmend::simulate

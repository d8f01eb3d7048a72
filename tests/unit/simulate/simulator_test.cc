#include "tools/simulate/simulator.h"

#include <gtest/gtest.h>

namespace mapmend::simulate {
namespace simulator_test {

const std::string kData = std::string(MAPMEND_SOURCE_DIR) + "/data";

Scenario Small() {
  Scenario scenario = ReadScenario("uav_short", kData + "/scenarios");
  scenario.camera = scenario.camera.Scaled(0.25);
  scenario.scene.aerial.x0 = scenario.scene.aerial.y0 = -50;
  scenario.scene.aerial.width = scenario.scene.aerial.length = 140;
  scenario.scene.aerial.texel = 0.4;
  scenario.sensor.readout_ms = 20;
  return scenario;
}

TEST(Simulator, IsBitIdenticalWhateverTheThreadsAndTheOrder) {
  Simulator one(Small(), kData, 1), three(Small(), kData, 3);
  Frame a, b;
  one.Render(4, &a);
  three.Render(9, &b);
  EXPECT_NE(a.bgr, b.bgr);
  three.Render(4, &b);
  EXPECT_EQ(a.bgr, b.bgr);
  EXPECT_EQ(FormatTerrain(one), FormatTerrain(three));
  Scenario other = Small();
  other.seed += 1;
  Simulator different(other, kData, 2);
  different.Render(4, &b);
  EXPECT_NE(a.bgr, b.bgr);
}

TEST(Simulator, EventsShowInFramesAndInTheReport) {
  Simulator simulator(Small(), kData, 2);
  EXPECT_TRUE(simulator.LeftOut(300));
  EXPECT_TRUE(simulator.LeftOut(354));
  EXPECT_FALSE(simulator.LeftOut(299));
  EXPECT_FALSE(simulator.LeftOut(355));
  EXPECT_GT(simulator.Sensor(456).gain[1], 20) << "over-exposed";
  EXPECT_NEAR(simulator.Sensor(440).gain[1], 1, 0.4);
  const std::string events = FormatEvents(simulator, 0, 599);
  EXPECT_NE(events.find("\"kind\": \"skip\""), std::string::npos);
  EXPECT_NE(events.find("\"first_written_frame\": 300"), std::string::npos);
  const std::string gps = FormatGps(simulator, 0, 599);
  EXPECT_EQ(std::count(gps.begin(), gps.end(), '\n'), 1 + 120) << "one a second";
}

TEST(Simulator, WaterFillsTheMiddleOfItsEvent) {
  Scenario scenario = Small();
  scenario.events = {{Event::Kind::kWater, 1, 2, 0}};
  scenario.sensor.noise = 0;
  Simulator simulator(scenario, kData, 2);
  Frame frame;
  simulator.Render(10, &frame);
  // Without texture: neighbours differ by nothing but vignetting.
  int differences = 0;
  for (size_t i = 3; i < frame.bgr.size(); ++i) differences += std::abs(frame.bgr[i] - frame.bgr[i - 3]) > 3;
  EXPECT_LT(differences, static_cast<int>(frame.bgr.size() / 50));
}

TEST(Simulator, AliasedLandRepeatsExactly) {
  Scenario scenario = Small();
  scenario.scene.aerial.width = 240;
  scenario.scene.aerial.repeat_x = 100;
  Simulator simulator(scenario, kData, 2);
  const Scene& scene = simulator.GetScene();
  double largest = 0;
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d a(-40 + 0.4 * k, -30 + 0.5 * k, 100), b = a + Eigen::Vector3d(100, 0, 0), down(0, 0, -1);
    largest = std::max(largest, std::abs(scene.Cast(a, down).distance - scene.Cast(b, down).distance));
  }
  EXPECT_LT(largest, 1e-3);
}

TEST(Simulator, TwinLooksTheSameASecondTimeAndNothingElseDoes) {
  Scenario scenario = Small();
  AerialOptions& aerial = scenario.scene.aerial;
  aerial.relief = 0;
  aerial.houses = 0;
  aerial.twin = {aerial.x0 + 10, aerial.y0 + 10, aerial.x0 + 60, aerial.y0 + 20, 30};
  Simulator simulator(scenario, kData, 2);
  const Scene& scene = simulator.GetScene();
  const auto difference = [&](double x, double y) {
    const Eigen::Vector3d a(aerial.x0 + x, aerial.y0 + y, 100), b = a + Eigen::Vector3d(50, 10, 0), down(0, 0, -1);
    const Hit hit_a = scene.Cast(a, down), hit_b = scene.Cast(b, down);
    return std::abs(hit_a.distance - hit_b.distance);
  };
  double inside = 0, outside = 0;
  for (double step = 0; step < 28; step += 0.37) {
    inside = std::max(inside, difference(11 + step, 38 - step));
    outside = std::max(outside, difference(11 + step, 41 + step / 3));
  }
  EXPECT_LT(inside, 1e-3);
  EXPECT_GT(outside, 0.1);
}

}  // namespace simulator_test
}  // namespace mapmend::simulate

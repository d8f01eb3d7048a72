#include "libs/positioning/placement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/degree.h"
#include "libs/base/random.h"

namespace mapmend {
namespace placement_test {

const Geodetic kOrigin{28.04, -82.7, 5};

double Normal(Random* random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random->Uniform();
  return sum;
}

// A camera that looks straight down flies strips of 200 m, 50 m apart, at 10 m/s; a frame every half second.
struct Flight {
  std::vector<TrackPoint> truth;  // cam_from_map holds cam_from_enu
  std::vector<PositionFix> fixes;
};

struct FlightOptions {
  int num_strips = 4;
  double noise = 0, fix_interval_s = 1;
  bool with_angles = false;
  double clock_s = 0;  // the receiver's clock minus the camera's
};

Flight Fly(const FlightOptions& options) {
  Flight flight;
  const LocalFrame frame(kOrigin);
  Random random(7);
  const auto place = [](double t) -> Eigen::Vector3d {
    const double strip_s = 25, s = std::fmod(t, strip_s) * 10;
    const int strip = static_cast<int>(t / strip_s);
    // 20 s along the strip, 5 s across to the next one; up and down a little on the way.
    const double along = std::min(s, 200.0), across = 50 * strip + std::max(0.0, s - 200);
    return {strip % 2 == 0 ? along : 200 - along, across, 80 + 2 * std::sin(t / 7)};
  };
  const double duration = options.num_strips * 25 - 5;
  for (double t = 0; t <= duration + 1e-9; t += 0.5) {
    const bool is_back = static_cast<int>(t / 25) % 2 == 1;
    const Eigen::Quaterniond rotation = CameraRotation(is_back ? 270 : 90, -90, 0);
    const Rigid3 enu_from_cam(rotation, place(t));
    flight.truth.push_back({0, 1600000000000000 + std::llround(t * 1e6), enu_from_cam.Inverse()});
  }
  for (double t = -5; t <= duration + 5; t += options.fix_interval_s) {
    const double inside = std::clamp(t, 0.0, duration);
    Eigen::Vector3d enu = place(inside);
    for (int i = 0; i < 3; ++i) enu[i] += options.noise * Normal(&random);
    const Geodetic geodetic = frame.ToGeodetic(enu);
    PositionFix fix;
    fix.utime = 1600000000000000 + std::llround((t + options.clock_s) * 1e6);
    fix.latitude_deg = geodetic.latitude_deg;
    fix.longitude_deg = geodetic.longitude_deg;
    fix.altitude_m = geodetic.altitude_m;
    if (options.with_angles) {
      fix.yaw_deg = static_cast<int>(inside / 25) % 2 == 1 ? 270 : 90;
      fix.pitch_deg = -88;  // mounted a little wrong
      fix.roll_deg = 0;
    }
    flight.fixes.push_back(fix);
  }
  return flight;
}

Similarity3 SomeWorld() { return {0.037, Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {3, -4, 11}}; }

std::vector<TrackPoint> InMap(const std::vector<TrackPoint>& truth, size_t begin, size_t end,
                              const Similarity3& map_from_enu) {
  std::vector<TrackPoint> track(truth.begin() + static_cast<long>(begin), truth.begin() + static_cast<long>(end));
  for (TrackPoint& point : track) point.cam_from_map = TransformWorld(point.cam_from_map, map_from_enu);
  return track;
}

// Largest distance of a placed camera from the truth, metres. The frame's origin is the first fix.
double LargestError(const WorldPlacement& world, size_t component, const std::vector<TrackPoint>& track,
                    const Flight& flight, size_t begin) {
  const LocalFrame truth_frame(kOrigin);
  double largest = 0;
  for (size_t i = 0; i < track.size(); ++i) {
    const Eigen::Vector3d truth =
        world.frame.ToEnu(truth_frame.ToGeodetic(flight.truth[begin + i].cam_from_map.Center()));
    const Eigen::Vector3d placed = world.components[component].enu_from_map * track[i].cam_from_map.Center();
    largest = std::max(largest, (placed - truth).norm());
  }
  return largest;
}

WorldPlacement PlaceAll(const Flight& flight, std::vector<TrackPoint>* track) {
  *track = InMap(flight.truth, 0, flight.truth.size(), SomeWorld());
  return PlaceComponents({*track}, {{flight.fixes}}, {});
}

TEST(Placement, IsExactWithoutNoise) {
  const Flight flight = Fly({});
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  EXPECT_LT(LargestError(world, 0, track, flight, 0), 0.1);  // a fix between two frames is near a straight line
  EXPECT_EQ(world.clocks[0].offset_us, 0);
  EXPECT_TRUE(world.components[0].open.empty());
  EXPECT_NEAR(world.components[0].enu_from_map.scale * SomeWorld().scale, 1, 1e-3);
}

TEST(Placement, SaysHowWellItIsKnown) {
  FlightOptions options;
  options.noise = 1.5;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  const Placement& placement = world.components[0];
  EXPECT_NEAR(placement.median_horizontal_m, 1.77, 0.4);  // 1.18 sigma
  EXPECT_LT(LargestError(world, 0, track, flight, 0), 4 * placement.SigmaHorizontal());
  EXPECT_GT(placement.SigmaHorizontal(), 0.1);
  EXPECT_LT(placement.SigmaHorizontal(), 1.5);
  EXPECT_LT(placement.SigmaHeadingDeg(), 2);
}

TEST(Placement, LetsGoOfOutliers) {
  FlightOptions options;
  options.noise = 0.5;
  Flight flight = Fly(options);
  for (size_t i = 10; i < flight.fixes.size(); i += 5) flight.fixes[i].latitude_deg += 0.0005;  // 55 m, a fifth of them
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  EXPECT_LT(LargestError(world, 0, track, flight, 0), 1);
  EXPECT_GE(world.components[0].num_outliers, 15);
}

TEST(Placement, ClockOffsetIsFoundAndTold) {
  FlightOptions options;
  options.noise = 0.5;
  options.clock_s = 7.3;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  EXPECT_NEAR(1e-6 * static_cast<double>(world.clocks[0].offset_us), -7.3, 0.1);
  EXPECT_GT(world.clocks[0].sigma_s, 0);
  EXPECT_LT(LargestError(world, 0, track, flight, 0), 1.5);
}

TEST(Placement, ClocksOfOtherTimeZonesAndOtherBeginnings) {
  for (const double clock_s : {-4 * 3600.0 + 1.0, -1.6e9}) {
    FlightOptions options;
    options.noise = 0.3;
    options.clock_s = clock_s;
    const Flight flight = Fly(options);
    std::vector<TrackPoint> track;
    const WorldPlacement world = PlaceAll(flight, &track);
    ASSERT_EQ(world.problem, "") << clock_s;
    EXPECT_NEAR(1e-6 * static_cast<double>(world.clocks[0].offset_us), -clock_s, 0.2) << clock_s;
  }
}

TEST(Placement, PositionsOfAnotherDayAreTold) {
  FlightOptions options;
  options.clock_s = 3 * 86400;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  EXPECT_NE(world.problem.find("no position is of the time of the flight"), std::string::npos) << world.problem;
  EXPECT_FALSE(world.components[0].success);
}

TEST(Placement, PositionsOfAnotherFlightAreTold) {
  FlightOptions options;
  options.noise = 0.5;
  Flight flight = Fly(options);
  Random random(3);  // somewhere in the same square
  for (PositionFix& fix : flight.fixes) {
    fix.latitude_deg = kOrigin.latitude_deg + 0.002 * random.Uniform();
    fix.longitude_deg = kOrigin.longitude_deg + 0.002 * random.Uniform();
  }
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  EXPECT_NE(world.problem.find("do not fit"), std::string::npos) << world.problem;
}

TEST(Placement, OnALineTheTiltIsOpenAndAssumed) {
  FlightOptions options;
  options.num_strips = 1;
  options.noise = 0.5;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  const Placement& placement = world.components[0];
  ASSERT_EQ(placement.open, std::vector<std::string>{"tilt about the line of flight"});
  EXPECT_GT(placement.SigmaTiltDeg(), 10);
  // The camera looks down and its images are upright: 45 degrees are between the two.
  const Eigen::Vector3d down =
      placement.enu_from_map.rotation * (track[0].cam_from_map.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  EXPECT_LT(std::acos(-down.z()), 50 * kDegree);
}

TEST(Placement, OnALineAnglesOfTheCameraTellTheTilt) {
  FlightOptions options;
  options.num_strips = 1;
  options.noise = 0.5;
  options.with_angles = true;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  const Placement& placement = world.components[0];
  EXPECT_TRUE(placement.open.empty());
  EXPECT_NE(placement.problem.find("angles of the camera"), std::string::npos) << placement.problem;
  const Eigen::Vector3d down =
      placement.enu_from_map.rotation * (track[0].cam_from_map.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  EXPECT_LT(std::acos(-down.z()), 6 * kDegree);
}

TEST(Placement, TooFewPositions) {
  Flight flight = Fly({});
  flight.fixes.resize(12);
  flight.fixes.erase(flight.fixes.begin(), flight.fixes.begin() + 10);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  EXPECT_NE(world.problem.find("2 positions are too few"), std::string::npos) << world.problem;
}

TEST(Placement, StandingStill) {
  Flight flight = Fly({});
  for (PositionFix& fix : flight.fixes) {
    fix.latitude_deg = kOrigin.latitude_deg;
    fix.longitude_deg = kOrigin.longitude_deg;
    fix.altitude_m = 10;
  }
  std::vector<TrackPoint> track;
  EXPECT_NE(PlaceAll(flight, &track).problem, "");
}

TEST(Placement, PartsThatNothingJoinsLieInOneWorld) {
  FlightOptions options;
  options.noise = 0.5;
  const Flight flight = Fly(options);
  const size_t half = flight.truth.size() / 2;
  const Similarity3 other(4, Eigen::Quaterniond(1, 0.2, 0, -3).normalized(), {0, 0, 9});
  const std::vector<TrackPoint> first = InMap(flight.truth, 0, half, SomeWorld()),
                                second = InMap(flight.truth, half + 4, flight.truth.size(), other);
  const WorldPlacement world = PlaceComponents({first, second}, {{flight.fixes}}, {});
  ASSERT_EQ(world.problem, "");
  EXPECT_LT(LargestError(world, 0, first, flight, 0), 1.5);
  EXPECT_LT(LargestError(world, 1, second, flight, half + 4), 1.5);
}

TEST(Placement, DenserFixesThanFrames) {
  FlightOptions options;
  options.fix_interval_s = 0.1;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement world = PlaceAll(flight, &track);
  ASSERT_EQ(world.problem, "");
  EXPECT_EQ(world.components[0].residuals.size(), track.size());
  EXPECT_LT(LargestError(world, 0, track, flight, 0), 0.05);
}

TEST(Placement, IsTheSameEachTime) {
  FlightOptions options;
  options.noise = 1.5;
  const Flight flight = Fly(options);
  std::vector<TrackPoint> track;
  const WorldPlacement a = PlaceAll(flight, &track), b = PlaceAll(flight, &track);
  EXPECT_EQ(ToArray(a.components[0].enu_from_map), ToArray(b.components[0].enu_from_map));
}

TEST(CameraRotation, LooksWhereItShould) {
  const Eigen::Vector3d forward(0, 0, 1), right(1, 0, 0), down(0, 1, 0);
  const Eigen::Quaterniond east = CameraRotation(90, 0, 0), nadir = CameraRotation(0, -90, 0);
  EXPECT_LT((east * forward - Eigen::Vector3d::UnitX()).norm(), 1e-9);
  EXPECT_LT((east * right + Eigen::Vector3d::UnitY()).norm(), 1e-9);  // south
  EXPECT_LT((east * down + Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT((nadir * forward + Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT((nadir * right - Eigen::Vector3d::UnitX()).norm(), 1e-9);  // the top of the image is north
  // Rolled to the right, its right side points downwards.
  EXPECT_LT((CameraRotation(0, 0, 30) * right).z(), -0.4);
}

}  // namespace placement_test
}  // namespace mapmend

#include "procs/mosaic/tile_frames.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace tile_frames_test {

// The flight's map without connections: each submap is a part of its own.
struct ApartFlight {
  explicit ApartFlight(int num_submaps) : flight(Options(num_submaps)) {
    for (const Record& record : flight.Records()) model.Apply(record);
    snapshot = MakeSnapshot(model);
    parts = PartsOf(snapshot);
  }
  static TestFlightOptions Options(int num_submaps) {
    TestFlightOptions options;
    options.num_submaps = num_submaps;
    return options;
  }
  // As if the positions had placed the first parts; off: how far to the east, metres.
  WorldPlacement World(size_t num_placed, double off = 0) const {
    WorldPlacement world;
    world.frame = LocalFrame({47.3, 8.5, 400});
    world.components.resize(parts.size());
    for (size_t c = 0; c < num_placed; ++c) {
      world.components[c].success = true;
      const int submap = snapshot.components[c].submaps.front();
      world.components[c].enu_from_map =
          Similarity3(1, Eigen::Quaterniond::Identity(), {off, 0, 0}) * flight.WorldFromSubmap(submap);
    }
    return world;
  }

  TestFlight flight;
  MapModel model;
  Snapshot snapshot;
  std::vector<MapPart> parts;
};

bool Overlap(const GroundBounds& a, const GroundBounds& b) {
  return (a.high.array() > b.low.array()).all() && (a.low.array() < b.high.array()).all();
}

TEST(TileFrames, WithoutPositionsPartsLieApartInPixelsOfOneSize) {
  const ApartFlight map(3);
  TileFrames frames({});
  frames.Update(map.snapshot, map.parts, nullptr, false);
  EXPECT_FALSE(frames.IsOnEarth());
  for (size_t a = 0; a < 3; ++a) {
    const TileFrames::Frame* frame = frames.Find(map.parts[a].name);
    ASSERT_NE(frame, nullptr);
    // Submap units are 10, 5 and 3.3 m, but the cameras fly at one height.
    const double metres =
        frame->ground_from_root.scale * map.flight.WorldFromSubmap(static_cast<int>(a)).Inverse().scale;
    const TileFrames::Frame* first = frames.Find(map.parts[0].name);
    EXPECT_NEAR(metres, first->ground_from_root.scale * map.flight.WorldFromSubmap(0).Inverse().scale, 0.02 * metres);
    const Eigen::Vector3d up =
        frame->ground_from_root.rotation *
        (map.flight.WorldFromSubmap(static_cast<int>(a)).rotation.conjugate() * Eigen::Vector3d::UnitZ());
    EXPECT_GT(up.z(), 0.999) << a;
    for (size_t b = 0; b < a; ++b) EXPECT_FALSE(Overlap(frame->bounds, frames.Find(map.parts[b].name)->bounds));
  }
}

TEST(TileFrames, AGrowingMapStaysWhereItIsAndANewProcessGoesOn) {
  const ApartFlight map(2);
  TileFrames frames({});
  frames.Update(map.snapshot, map.parts, nullptr, false);
  std::vector<std::array<double, 8>> before;
  for (const MapPart& part : map.parts) before.push_back(ToArray(frames.Find(part.name)->ground_from_root));
  const auto expect_same = [&](const TileFrames& now) {
    EXPECT_EQ(now.Zoom(), frames.Zoom());
    for (size_t c = 0; c < map.parts.size(); ++c)
      EXPECT_EQ(ToArray(now.Find(map.parts[c].name)->ground_from_root), before[c]) << c;
  };
  frames.Update(map.snapshot, map.parts, nullptr, false);
  expect_same(frames);
  TileFrames later({}, frames.ToText());
  expect_same(later);
  later.Update(map.snapshot, map.parts, nullptr, false);
  expect_same(later);
  EXPECT_EQ(TileFrames({}, "nonsense").Zoom(), 0);
}

TEST(TileFrames, OnTheEarthTilesAreThoseOfWebMaps) {
  const ApartFlight map(2);
  const WorldPlacement world = map.World(2);
  TileFrames frames({});
  frames.Update(map.snapshot, map.parts, &world, false);
  ASSERT_TRUE(frames.IsOnEarth());
  for (const Eigen::Vector2d& enu : {Eigen::Vector2d(0, 0), Eigen::Vector2d(400, -300), Eigen::Vector2d(-200, 450)}) {
    const Geodetic place = world.frame.ToGeodetic({enu.x(), enu.y(), 0});
    constexpr double kRadius = kHalfWorld / M_PI, kDegree = M_PI / 180;
    const double x = kRadius * place.longitude_deg * kDegree;
    const double y = kRadius * std::log(std::tan(M_PI / 4 + place.latitude_deg * kDegree / 2));
    EXPECT_LT((frames.Plane().ToTiles(enu) - Eigen::Vector2d(x, y)).norm(), 0.15) << "metres";
  }
  // A pixel is about as large as those of the images on the ground: 50 m over the focal length.
  const Pinhole camera = map.model.GetSession(map.model.SessionOrder()[0]).info.pinhole;
  const double pixel = TilePixelSize(frames.Zoom()) / frames.Plane().scale.x();
  EXPECT_GT(pixel / (50 / camera.fx), 0.8);
  EXPECT_LT(pixel / (50 / camera.fx), 1.75);
}

TEST(TileFrames, APartIsMovedOnlyIfItBelongsFarFromWhereItIs) {
  const ApartFlight map(1);
  TileFrames frames({});
  const auto place = [&](double off, bool is_fresh = false) {
    const WorldPlacement world = map.World(1, off);
    frames.Update(map.snapshot, map.parts, &world, is_fresh);
    return frames.Find(map.parts[0].name)->ground_from_root.translation.x();
  };
  const double at = place(0), pixel = TilePixelSize(frames.Zoom()) / frames.Plane().scale.x();
  EXPECT_EQ(place(10 * pixel), at);
  EXPECT_NEAR(place(40 * pixel), at + 40 * pixel, 1e-6);
  EXPECT_NEAR(place(45 * pixel), at + 40 * pixel, 1e-6);
  EXPECT_NEAR(place(45 * pixel, true), at + 45 * pixel, 1e-6) << "of a map that is final";
}

TEST(TileFrames, WhatHasNoPlaceOnTheEarthLiesBesideWhatHas) {
  const ApartFlight map(2);
  const WorldPlacement world = map.World(1);
  TileFrames frames({});
  frames.Update(map.snapshot, map.parts, &world, false);
  const TileFrames::Frame *placed = frames.Find(map.parts[0].name), *other = frames.Find(map.parts[1].name);
  ASSERT_TRUE(placed != nullptr && other != nullptr);
  EXPECT_TRUE(placed->is_on_earth);
  EXPECT_FALSE(other->is_on_earth);
  EXPECT_LT(other->bounds.high.y(), placed->bounds.low.y());
}

}  // namespace tile_frames_test
}  // namespace mapmend

#include "libs/mosaic/tile_mosaic.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/scratch_folder.h"
#include "tests/unit/mosaic/synthetic_ground.h"

namespace mapmend {
namespace tile_mosaic_test {

using Clock = std::chrono::steady_clock;

// A flight over the synthetic ground, an image for each id, on tiles of about the size of its pixels.
class Flight {
 public:
  static constexpr int kZoom = 22;  // 3.7 cm a pixel; images have 3.4

  static MosaicImage Image(int id, double shift = 0) {
    MosaicImage image{SyntheticGround::MakeCamera(), SyntheticGround::Above(2.5 * id + shift, 0, 10)};
    image.id = id;
    return image;
  }

  // Images first to last.
  static TileComponent Part(const std::string& name, int first, int last, bool is_joined = true, double shift = 0) {
    std::vector<MosaicImage> images;
    for (int id = first; id <= last; ++id) images.push_back(Image(id, shift));
    std::vector<Eigen::Vector3d> points;
    for (double x = -12; x <= 80; x += 0.5) {
      for (double y = -12; y <= 12; y += 0.5) points.emplace_back(x, y, 0);
    }
    return {name, is_joined, GroundScene({}, images, points)};
  }

  static TileScene Scene(std::vector<TileComponent> parts) {
    TileScene scene;
    scene.zoom = kZoom;
    scene.components = std::move(parts);
    return scene;
  }
};

TileMosaicOptions MadeAnewAtOnce(double min_remake_s = 0) {
  TileMosaicOptions options;
  options.min_remake_s = min_remake_s;
  options.remake_share = 1;
  return options;
}

// A file of tiles with who makes them.
struct Maker {
  explicit Maker(const std::string& path, const TileMosaicOptions& options = MadeAnewAtOnce())
      : file(path), tiles(options, &file, [this](int id, int) {
          ++num_read;
          return SyntheticGround::View(Flight::Image(id));
        }) {}

  // All that is to be done. Returns how many units were made.
  int64_t Finish() {
    const int64_t before = tiles.NumMade();
    while (tiles.NumPending() > 0) tiles.Work(Clock::now() + std::chrono::seconds(1));
    return tiles.NumMade() - before;
  }

  int num_read = 0;
  TileFile file;
  TileMosaic tiles;
};

using Contents = std::map<TileAddress, std::vector<uint8_t>>;

Contents ContentsOf(const TileFile& file) {
  Contents contents;
  for (const TileAddress& tile : file.Tiles()) contents[tile] = *file.Tile(tile);
  return contents;
}

// Mean difference from the ground as it is, grey levels, of all that a tile shows.
double ErrorOf(const TileAddress& tile, const cv::Mat& picture) {
  const GroundBounds bounds = BoundsOf(tile);
  double sum = 0;
  int count = 0;
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      const auto& pixel = picture.at<cv::Vec4b>(y, x);
      if (pixel[3] == 0) continue;
      const double size = TilePixelSize(tile.zoom);
      const cv::Vec3b truth =
          SyntheticGround::ColorAt(bounds.low.x() + (x + 0.5) * size, bounds.high.y() - (y + 0.5) * size);
      for (int c = 0; c < 3; ++c) sum += std::abs(pixel[c] - truth[c]);
      count += 3;
    }
  }
  return count > 0 ? sum / count : 0;
}

TEST(TileMosaic, ShowsTheGround) {
  const ScratchFolder folder;
  Maker maker(folder.File("a.mbtiles"));
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 5)}), {0, 0}, true);
  EXPECT_GT(maker.Finish(), 0);
  int num_finest = 0;
  for (const auto& [tile, bytes] : ContentsOf(maker.file)) {
    if (tile.zoom != Flight::kZoom) continue;
    ++num_finest;
    EXPECT_LT(ErrorOf(tile, DecodeTile(bytes)), 3) << tile.column << " " << tile.row;
  }
  // 6 images of 10.7 x 8 m, 2.5 m apart, on tiles of 9.6 m.
  EXPECT_GE(num_finest, 6);
  EXPECT_LE(num_finest, 12);
}

TEST(TileMosaic, WhatWasMadeAMomentAgoWaitsUnlessTheMapIsFinal) {
  constexpr double kAnHour = 3600;
  const ScratchFolder folder;
  Maker maker(folder.File("a.mbtiles"), MadeAnewAtOnce(kAnHour));
  const auto work = [&] {
    const int64_t before = maker.tiles.NumMade();
    while (maker.tiles.HasWork()) maker.tiles.Work(Clock::now() + std::chrono::seconds(1));
    return maker.tiles.NumMade() - before;
  };
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 20)}), {0, 0}, false);
  const int64_t all = work();
  EXPECT_GT(all, 0);
  // A little further: some units show more, and one or two are new.
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 23)}), {0, 0}, false);
  const int64_t few = work();
  EXPECT_GT(few, 0) << "ground that is not shown yet does not wait";
  EXPECT_GT(maker.tiles.NumPending(), 0);
  EXPECT_FALSE(maker.tiles.HasWork());
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 23)}), {0, 0}, true);
  EXPECT_GT(work(), 0) << "those that waited";
  EXPECT_EQ(maker.tiles.NumPending(), 0);
}

TEST(TileMosaic, WhatMovesALittleTakesAShareOfTheTimeAndWhatMovesFarDoesNotWait) {
  TileMosaicOptions options = MadeAnewAtOnce();
  options.remake_share = 0.001;
  const ScratchFolder folder;
  Maker maker(folder.File("a.mbtiles"), options);
  const auto work = [&](double shift) {
    maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 20, true, shift)}), {0, 0}, false);
    const int64_t before = maker.tiles.NumMade();
    while (maker.tiles.HasWork()) maker.tiles.Work(Clock::now());
    return maker.tiles.NumMade() - before;
  };
  const int64_t all = work(0);
  EXPECT_EQ(maker.tiles.NumPending(), 0);
  EXPECT_LE(work(0.3), all / 4) << "9 pixels";
  EXPECT_GT(maker.tiles.NumPending(), 0);
  EXPECT_GE(work(1.3), all / 2) << "30 pixels more";
  EXPECT_EQ(maker.tiles.NumPending(), 0);
}

TEST(TileMosaic, ANewImageChangesWhatItShowsAlone) {
  const ScratchFolder folder;
  Maker maker(folder.File("a.mbtiles"));
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 20)}), {0, 0}, false);
  const int64_t all = maker.Finish();
  const Contents before = ContentsOf(maker.file);
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 20)}), {0, 0}, false);
  EXPECT_EQ(maker.Finish(), 0) << "nothing has changed";
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 21)}), {0, 0}, false);
  const int64_t more = maker.Finish();
  EXPECT_GT(more, 0);
  EXPECT_LE(more, all / 2);
  int num_changed = 0;
  for (const auto& [tile, bytes] : ContentsOf(maker.file)) {
    const auto was = before.find(tile);
    if (tile.zoom != Flight::kZoom || (was != before.end() && was->second == bytes)) continue;
    ++num_changed;
    EXPECT_GT(BoundsOf(tile).high.x(), 2.5 * 20 - 5.4) << "left of all that the image shows";
  }
  EXPECT_GT(num_changed, 0);
}

TEST(TileMosaic, WhatMovesVisiblyIsMadeAnewAndWhatGoesIsTakenAway) {
  const ScratchFolder folder;
  Maker maker(folder.File("a.mbtiles"));
  const auto set = [&](double shift) {
    maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 3), Flight::Part("b", 10, 13, false, shift)}), {0, 0},
                         false);
    return maker.Finish();
  };
  EXPECT_GT(set(0), 0);
  EXPECT_EQ(set(0.05), 0) << "a pixel and a half";
  const int64_t moved = set(0.5);
  EXPECT_GT(moved, 0);
  maker.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 3)}), {0, 0}, false);
  maker.Finish();
  for (const TileAddress& tile : maker.file.Tiles()) {
    if (tile.zoom == Flight::kZoom) {
      EXPECT_LT(BoundsOf(tile).low.x(), 2.5 * 3 + 5.4);
    }
  }
}

TEST(TileMosaic, PartsThatAreNotJoinedAreHatchedAndLieBelow) {
  const ScratchFolder folder;
  Maker joined(folder.File("a.mbtiles")), apart(folder.File("b.mbtiles"));
  joined.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 3), Flight::Part("b", 2, 8, true)}), {0, 0}, true);
  apart.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 3), Flight::Part("b", 2, 8, false)}), {0, 0}, true);
  joined.Finish();
  apart.Finish();
  double of_a = 0, of_b = 0;
  for (const auto& [tile, bytes] : ContentsOf(apart.file)) {
    if (tile.zoom != Flight::kZoom) continue;
    cv::Mat difference;
    cv::absdiff(DecodeTile(bytes), DecodeTile(*joined.file.Tile(tile)), difference);
    const double mean = cv::mean(difference)[0];
    if (BoundsOf(tile).high.x() < 2.5 * 3) of_a = std::max(of_a, mean);
    if (BoundsOf(tile).low.x() > 2.5 * 3 + 5.4) of_b = std::max(of_b, mean);
  }
  EXPECT_EQ(of_a, 0);
  EXPECT_GT(of_b, 1) << "lines";
}

// However often who makes them is stopped and started again, in whatever state of the map.
TEST(TileMosaic, TheSameTilesInTheEnd) {
  const ScratchFolder folder;
  Maker calm(folder.File("calm.mbtiles"));
  calm.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 12)}), {0, 0}, true);
  calm.Finish();
  for (int last = 2; last < 12; last += 3) {
    Maker shaken(folder.File("shaken.mbtiles"));
    shaken.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, last, true, 0.02 * last), Flight::Part("b", 20, 22)}),
                          {30, 0}, false);
    for (int i = 0; i < 3; ++i) shaken.tiles.Work(Clock::now());
  }
  Maker shaken(folder.File("shaken.mbtiles"));
  shaken.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 12)}), {0, 0}, true);
  shaken.tiles.Work(Clock::now());
  shaken.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 12)}), {30, 0}, true);
  shaken.Finish();
  EXPECT_EQ(ContentsOf(shaken.file), ContentsOf(calm.file));
  // And whoever comes then has nothing to do.
  Maker late(folder.File("calm.mbtiles"));
  late.tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 12)}), {0, 0}, true);
  EXPECT_EQ(late.Finish(), 0);
  EXPECT_EQ(late.num_read, 0);
}

TEST(TileMosaic, AnImageThatCannotBeReadLeavesItsUnitsForLater) {
  const ScratchFolder folder;
  TileFile file(folder.File("a.mbtiles"));
  bool is_silent = true;
  TileMosaic tiles({}, &file, [&](int id, int) {
    if (is_silent) throw std::runtime_error("the store does not answer");
    return SyntheticGround::View(Flight::Image(id));
  });
  tiles.SetScene(Flight::Scene({Flight::Part("a", 0, 3)}), {0, 0}, false);
  const int pending = tiles.NumPending();
  EXPECT_THROW(tiles.Work(Clock::now()), std::runtime_error);
  EXPECT_EQ(tiles.NumPending(), pending);
  is_silent = false;
  while (tiles.NumPending() > 0) tiles.Work(Clock::now());
  EXPECT_GT(file.Tiles().size(), 0u);
}

}  // namespace tile_mosaic_test
}  // namespace mapmend

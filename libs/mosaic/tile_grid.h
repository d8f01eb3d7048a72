#pragma once

#include <algorithm>
#include <cmath>
#include <compare>
#include <numbers>

#include "libs/mosaic/ground_surface.h"
#include "libs/mosaic/rectified_patch.h"

namespace mapmend {

// The tiles of web maps (EPSG:3857): at zoom z the square of 2^z x 2^z tiles covers the world, metres of the equator,
// x to the east, y to the north. What is not on the earth uses the same square as a plane.
inline constexpr int kTilePixels = 256;
inline constexpr double kHalfWorld = 20037508.342789244;                  // from the centre to the border
inline constexpr double kMercatorRadius = kHalfWorld / std::numbers::pi;  // of the sphere that web maps take
inline constexpr int kMaxZoom = 30;

struct TileAddress {
  int zoom = 0, column = 0, row = 0;  // row 0 is the northernmost
  auto operator<=>(const TileAddress&) const = default;

  TileAddress Parent() const { return {zoom - 1, column / 2, row / 2}; }
  // 0: north-west, 1: north-east, 2: south-west, 3: south-east
  TileAddress Child(int i) const { return {zoom + 1, 2 * column + i % 2, 2 * row + i / 2}; }
};

inline double TileSize(int zoom) { return 2 * kHalfWorld / std::ldexp(1, zoom); }
inline double TilePixelSize(int zoom) { return TileSize(zoom) / kTilePixels; }
// At which pixels are at least 0.84 and less than 1.68 times as large.
inline int ZoomOf(double pixel_size) {
  constexpr double kFiner = 0.25;  // octaves
  return std::clamp(static_cast<int>(std::floor(std::log2(TilePixelSize(0) / pixel_size) + kFiner)), 0, kMaxZoom);
}

inline TileAddress TileAt(int zoom, const Eigen::Vector2d& place) {
  const double size = TileSize(zoom);
  const auto index = [&](double along) {
    return static_cast<int>(std::clamp(std::floor(along / size), 0.0, std::ldexp(1, zoom) - 1));
  };
  return {zoom, index(place.x() + kHalfWorld), index(kHalfWorld - place.y())};
}

// Where the ground lies on the square: the two have the same axes.
struct TilePlane {
  Eigen::Vector2d scale = Eigen::Vector2d::Ones();   // of what is on the square, of what is on the ground
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // of the ground's origin, on the square

  Eigen::Vector2d ToTiles(const Eigen::Vector2d& ground) const { return ground.cwiseProduct(scale) + offset; }
  Eigen::Vector2d ToGround(const Eigen::Vector2d& on_square) const { return (on_square - offset).cwiseQuotient(scale); }
  GroundBounds ToTiles(const GroundBounds& ground) const { return {ToTiles(ground.low), ToTiles(ground.high)}; }
  GroundBounds ToGround(const GroundBounds& on_square) const {
    return {ToGround(on_square.low), ToGround(on_square.high)};
  }
};

// On the square.
inline GroundBounds BoundsOf(const TileAddress& tile) {
  const double size = TileSize(tile.zoom);
  const Eigen::Vector2d north_west(tile.column * size - kHalfWorld, kHalfWorld - tile.row * size);
  return {{north_west.x(), north_west.y() - size}, {north_west.x() + size, north_west.y()}};
}

}  // namespace mapmend

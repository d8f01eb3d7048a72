#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libs/mosaic/ground_scene.h"
#include "libs/mosaic/tile_grid.h"

namespace mapmend {

// A part of the map whose pieces are joined.
struct TileComponent {
  std::string name;        // unique, stays the same while the map grows
  bool is_joined = false;  // to the main part: the others are hatched
  GroundScene scene;       // the frame is common to all; images have ids
};

// All that tiles are made of.
struct TileScene {
  int zoom = 0;  // the finest
  TilePlane plane;
  std::vector<TileComponent> components;  // the first to show a place is shown
};

// What a unit, a square of ground that is made at once, was made of.
struct TileRecipe {
  struct Image {
    int id = -1;
    std::string component;
    std::array<float, 3> gains = {1, 1, 1};
    std::array<Eigen::Vector2f, 9> pixels;  // where it shows the unit's corners, middles and centre
  };
  uint64_t fingerprint = 0;   // of everything that makes a difference, to the last bit
  std::vector<Image> images;  // that are shown

  std::string ToText() const;
  static std::optional<TileRecipe> FromText(const std::string& text);
};

// The recipe as of now. No images: nothing is to be seen.
TileRecipe MakeRecipe(const TileScene& scene, const TileAddress& unit);

struct RecipeTolerance {
  double pixels = 5;   // of an image: what moved less stays as it is
  double gain = 0.05;  // relative
  double quality = 2;  // times: another image is better by so much
  double share = 0.3;  // of the unit, for which a better image is there
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("pixels", pixels, AtLeast(0), "pixels of an image");
    v("gain", gain, AtLeast(0));
    v("quality", quality, AtLeast(1));
    v("share", share, Range(0, 1), "of the unit");
  }
};

// Whether a unit that was made so is still good enough.
bool IsGoodEnough(const TileScene& scene, const TileAddress& unit, const TileRecipe& made,
                  const RecipeTolerance& tolerance);

}  // namespace mapmend

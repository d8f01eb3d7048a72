#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "libs/base/range.h"
#include "libs/mosaic/ground_part.h"
#include "libs/mosaic/image_cache.h"
#include "libs/mosaic/tile_file.h"
#include "libs/mosaic/tile_recipe.h"

namespace mapmend {

struct TileMosaicOptions {
  RecipeTolerance tolerance;       // while the map grows
  int blend_levels = 4;            // octaves; seams are as wide as the coarsest of them
  int max_cached_megabytes = 100;  // of decoded images
  int num_zooms = 9;               // of the pyramid, from the finest
  int hatch_px = 24;               // distance of the lines over parts that are not joined
  // While the map grows a unit is made anew at most so often: the ground at the edge of what is seen changes with every
  // image.
  double min_remake_s = 2;
  // Nor does making units anew take more than this share of the time, unless images have moved by so many pixels: every
  // map moves a little while it grows.
  double remake_share = 0.15;
  double urgent_px = 20;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("tolerance", tolerance);
    v("blend_levels", blend_levels, Range(kMinBlendLevels, kMaxBlendLevels), "octaves");
    v("max_cached_megabytes", max_cached_megabytes, Range(1, 1e6), "MB");
    v("num_zooms", num_zooms, Range(1, kMaxZoom));
    v("hatch_px", hatch_px, Range(4, 1024), "pixels");
    v("min_remake_s", min_remake_s, AtLeast(0), "s");
    v("remake_share", remake_share, Range(0.001, 1), "of the time");
    v("urgent_px", urgent_px, MoreThan(0), "pixels");
  }
};

// A picture of the ground in tiles that follows a growing map: what a new scene changes is made anew, the rest stays.
// Ground is made in units of two by two tiles of the finest zoom. Each unit's recipe is kept with it, so whoever goes
// on with the file knows what is left to do.
class TileMosaic {
 public:
  // read: images by MosaicImage::id. It may throw; then the unit is left for later. file: must outlive it.
  TileMosaic(const TileMosaicOptions& options, TileFile* file, ReadMosaicImage read);

  // Takes over what is known now. Units that lie where anything has changed are looked at again.
  //   focus      what lies near is made first
  //   is_final   units are made of this scene to the last bit, whatever there is from earlier ones
  void SetScene(TileScene scene, const Eigen::Vector2d& focus, bool is_final);
  // An image has been read; as the cache would.
  void Keep(int id, cv::Mat image) { cache_.Put(id, std::move(image)); }

  // Units to be looked at; one more while coarser tiles are out of date.
  int NumPending() const { return static_cast<int>(pending_.size()) + (is_coarser_stale_ && scene_.zoom > 0 ? 1 : 0); }
  // Whether Work has anything to do now: units that were made a moment ago wait.
  bool HasWork() const { return Next().has_value() || MayUpdateCoarser(); }
  // Looks at units, and makes those that need it, until then; at least one. Throws what `read` throws.
  void Work(std::chrono::steady_clock::time_point until);
  int64_t NumMade() const { return num_made_; }  // units
  const TileScene& Scene() const { return scene_; }

 private:
  using Key = std::pair<std::string, int>;  // component, image

  void MarkChanges(const TileScene& next);
  void MarkHeights(const TileScene& next);
  void Mark(const GroundBounds& ground, bool is_urgent);
  std::optional<TileAddress> Next() const;
  bool IsDone(const TileAddress& unit) const;
  void Make(const TileAddress& unit, TileFile::Changes* changes);
  cv::Mat Picture(const TileAddress& unit);
  bool MayUpdateCoarser() const;
  void UpdateCoarser();
  int UnitZoom() const { return scene_.zoom - 1; }

  const TileMosaicOptions options_;
  TileFile* const file_;
  ImageCache cache_;
  TileScene scene_;
  Eigen::Vector2d focus_ = Eigen::Vector2d::Zero();
  bool is_final_ = false;
  std::set<TileAddress> pending_, urgent_;
  std::map<TileAddress, TileRecipe> made_;
  std::map<TileAddress, std::chrono::steady_clock::time_point> made_at_;  // by this process
  std::chrono::steady_clock::time_point next_remake_;
  std::map<Key, GroundView> marked_;                          // images where they were when units were marked for them
  std::map<TileAddress, std::array<float, 9>> seen_heights_;  // of the surface, likewise
  int64_t num_made_ = 0;
  bool is_coarser_stale_ = true;  // as far as is known
  std::chrono::steady_clock::time_point coarser_updated_;
};

}  // namespace mapmend

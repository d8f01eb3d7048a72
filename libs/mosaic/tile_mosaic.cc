#include "libs/mosaic/tile_mosaic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

namespace mapmend {
namespace {

constexpr int kUnitPixels = 2 * kTilePixels;

// Corners, middles and centre.
std::array<Eigen::Vector2d, 9> NinePlaces(const GroundBounds& bounds) {
  std::array<Eigen::Vector2d, 9> places;
  for (size_t i = 0; i < places.size(); ++i) {
    const size_t column = i % 3, row = i / 3;
    const Eigen::Array2d share(0.5 * static_cast<double>(column), 0.5 * static_cast<double>(row));
    places[i] = bounds.low + (bounds.Size().array() * share).matrix();
  }
  return places;
}

// Whether an image shows the ground elsewhere than before, by more than so many pixels. Places that only one of the two
// knows, beyond the border of the other, tell nothing, unless there are no others.
bool HasMoved(const GroundView& before, const GroundView& now, const GroundScene& scene, const GroundBounds& footprint,
              double pixels) {
  bool is_any_known = false, is_any_shown = false;
  for (const Eigen::Vector2d& place : NinePlaces(footprint)) {
    const auto was = before.Project(scene.OnSurface(place)), is = now.Project(scene.OnSurface(place));
    const bool is_shown = (was && was->inside >= 0) || (is && is->inside >= 0);
    is_any_shown = is_any_shown || is_shown;
    if (!is_shown || !was || !is) continue;
    if ((was->pixel - is->pixel).norm() > pixels) return true;
    is_any_known = true;
  }
  return is_any_shown && !is_any_known;
}

// Neighbours on the ground are neighbours in this order (G. Morton, 1966), so that images in memory are used again.
uint64_t MortonIndex(const TileAddress& tile) {
  uint64_t index = 0;
  for (int bit = 0; bit < kMaxZoom; ++bit) {
    index |= static_cast<uint64_t>((tile.column >> bit) & 1) << (2 * bit);
    index |= static_cast<uint64_t>((tile.row >> bit) & 1) << (2 * bit + 1);
  }
  return index;
}

// Lines over a part that is not joined, which go on from unit to unit.
void Hatch(const TileAddress& unit, int distance, GroundPart* part) {
  const int64_t first = (static_cast<int64_t>(unit.column) + unit.row) * kUnitPixels;
  constexpr int kWidth = 3;
  for (int y = 0; y < part->color.rows; ++y) {
    auto* pixel = part->color.ptr<cv::Vec3b>(y);
    for (int x = 0; x < part->color.cols; ++x) {
      if ((first + x + y) % distance >= kWidth) continue;
      for (int c = 0; c < 3; ++c) pixel[x][c] = static_cast<uint8_t>((pixel[x][c] + 255) / 2);
    }
  }
}

}  // namespace

TileMosaic::TileMosaic(const TileMosaicOptions& options, TileFile* file, ReadMosaicImage read)
    : options_(options), file_(file), cache_(std::move(read), options.max_cached_megabytes) {
  for (const auto& [unit, text] : file_->Notes()) {
    if (auto recipe = TileRecipe::FromText(text)) made_[unit] = std::move(*recipe);
  }
}

void TileMosaic::SetScene(TileScene scene, const Eigen::Vector2d& focus, bool is_final) {
  focus_ = focus;
  const bool is_of_another_zoom =
      std::any_of(made_.begin(), made_.end(), [&](const auto& made) { return made.first.zoom != scene.zoom - 1; });
  if (is_of_another_zoom || (scene_.zoom != 0 && scene_.zoom != scene.zoom)) {
    file_->Clear();
    made_.clear();
    pending_.clear();
    marked_.clear();
    seen_heights_.clear();
    made_at_.clear();
    urgent_.clear();
  }
  is_final_ = is_final;
  scene_.zoom = scene.zoom;
  scene_.plane = scene.plane;
  if (is_final) {
    marked_.clear();  // so that everything is marked
    for (const auto& [unit, recipe] : made_) pending_.insert(unit);
  }
  MarkChanges(scene);
  MarkHeights(scene);
  scene_ = std::move(scene);
}

void TileMosaic::MarkChanges(const TileScene& next) {
  std::map<Key, GroundView> before = std::exchange(marked_, {});
  std::set<Key> unmoved;
  for (const TileComponent& component : next.components) {
    const GroundScene& scene = component.scene;
    for (int i = 0; i < scene.NumImages(); ++i) {
      const Key key(component.name, scene.Image(i).id);
      const auto was = before.find(key);
      const auto has_moved_by = [&](double pixels) {
        return HasMoved(was->second, scene.View(i), scene, scene.Footprint(i), pixels);
      };
      const bool is_known = was != before.end();
      const bool stays = is_known && !has_moved_by(options_.tolerance.pixels / 2);
      marked_.emplace(key, stays ? was->second : scene.View(i));
      if (stays) {
        unmoved.insert(key);
      } else {
        Mark(scene.Footprint(i), is_known && has_moved_by(options_.urgent_px));
      }
    }
  }
  // Where the others have been.
  for (const auto& [unit, recipe] : made_) {
    if (std::any_of(recipe.images.begin(), recipe.images.end(), [&](const TileRecipe::Image& image) {
          return !unmoved.contains({image.component, image.id});
        }))
      pending_.insert(unit);
  }
}

void TileMosaic::MarkHeights(const TileScene& next) {
  const double least = options_.tolerance.pixels * TilePixelSize(next.zoom) / next.plane.scale.x();
  for (const auto& [unit, made] : made_) {
    const std::string name = made.images.empty() ? "" : made.images.front().component;
    const auto component = std::find_if(next.components.begin(), next.components.end(),
                                        [&](const TileComponent& c) { return c.name == name; });
    if (component == next.components.end()) continue;
    std::array<float, 9> heights = {};
    const auto places = NinePlaces(next.plane.ToGround(BoundsOf(unit)));
    for (size_t i = 0; i < places.size(); ++i)
      heights[i] = static_cast<float>(component->scene.Surface().Height(places[i].x(), places[i].y()));
    const auto [known, is_new] = seen_heights_.try_emplace(unit, heights);
    bool has_changed = is_new;
    for (size_t i = 0; i < heights.size(); ++i)
      has_changed = has_changed || std::abs(heights[i] - known->second[i]) > least;
    if (!has_changed) continue;
    known->second = heights;
    pending_.insert(unit);
  }
}

void TileMosaic::Mark(const GroundBounds& ground, bool is_urgent) {
  const GroundBounds bounds = scene_.plane.ToTiles(ground);
  const TileAddress first = TileAt(UnitZoom(), {bounds.low.x(), bounds.high.y()}),
                    last = TileAt(UnitZoom(), {bounds.high.x(), bounds.low.y()});
  constexpr int kMost = 256;  // units along a side: an image to the horizon
  for (int row = first.row; row <= std::min(last.row, first.row + kMost); ++row) {
    for (int column = first.column; column <= std::min(last.column, first.column + kMost); ++column) {
      pending_.insert({UnitZoom(), column, row});
      if (is_urgent) urgent_.insert({UnitZoom(), column, row});
    }
  }
}

// While the map grows: ground that is not shown yet, then what is nearest; what was made a moment ago waits.
std::optional<TileAddress> TileMosaic::Next() const {
  using Order = std::tuple<int, double, uint64_t>;
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> least(options_.min_remake_s);
  std::optional<TileAddress> next;
  Order least_order;
  for (const TileAddress& unit : pending_) {
    Order order(0, 0.0, MortonIndex(unit));
    if (!is_final_) {
      const auto at = made_at_.find(unit);
      const bool is_early = now < next_remake_ || (at != made_at_.end() && now - at->second < least);
      if (is_early && made_.contains(unit) && !urgent_.contains(unit)) continue;
      const GroundBounds bounds = scene_.plane.ToGround(BoundsOf(unit));
      order = {made_.contains(unit) ? 1 : 0, ((bounds.low + bounds.high) / 2 - focus_).norm(), MortonIndex(unit)};
    }
    if (next && least_order <= order) continue;
    next = unit;
    least_order = order;
  }
  return next;
}

bool TileMosaic::IsDone(const TileAddress& unit) const {
  const auto made = made_.find(unit);
  if (is_final_) {
    const TileRecipe recipe = MakeRecipe(scene_, unit);
    return made == made_.end() ? recipe.images.empty() : made->second.fingerprint == recipe.fingerprint;
  }
  return IsGoodEnough(scene_, unit, made == made_.end() ? TileRecipe() : made->second, options_.tolerance);
}

cv::Mat TileMosaic::Picture(const TileAddress& unit) {
  const GroundBounds bounds = scene_.plane.ToGround(BoundsOf(unit));
  GroundRaster raster;
  raster.north_west = {bounds.low.x(), bounds.high.y()};
  raster.gsd = bounds.Size().x() / kUnitPixels;
  raster.stretch = bounds.Size().y() / bounds.Size().x();
  raster.width = raster.height = kUnitPixels;
  cv::Mat picture = cv::Mat::zeros(kUnitPixels, kUnitPixels, CV_8UC4);
  for (const TileComponent& component : scene_.components) {
    GroundPart part =
        MakeGroundPart(component.scene, raster, {0, 0, kUnitPixels, kUnitPixels}, options_.blend_levels, &cache_);
    if (part.color.empty()) continue;
    if (!component.is_joined) Hatch(unit, options_.hatch_px, &part);
    for (int y = 0; y < picture.rows; ++y) {
      auto* to = picture.ptr<cv::Vec4b>(y);
      const auto* color = part.color.ptr<cv::Vec3b>(y);
      const auto* mask = part.mask.ptr<uint8_t>(y);
      for (int x = 0; x < picture.cols; ++x) {
        constexpr uint8_t kOpaque = 255;
        if (mask[x] != 0 && to[x][3] == 0) to[x] = {color[x][0], color[x][1], color[x][2], kOpaque};
      }
    }
  }
  return picture;
}

void TileMosaic::Make(const TileAddress& unit, TileFile::Changes* changes) {
  TileRecipe recipe = MakeRecipe(scene_, unit);
  const cv::Mat picture = recipe.images.empty() ? cv::Mat::zeros(kUnitPixels, kUnitPixels, CV_8UC4) : Picture(unit);
  for (int i = 0; i < 4; ++i) {
    const cv::Rect at(i % 2 * kTilePixels, i / 2 * kTilePixels, kTilePixels, kTilePixels);
    changes->tiles[unit.Child(i)] = EncodeTile(picture(at));
  }
  changes->notes[unit] = recipe.images.empty() ? "" : recipe.ToText();
  made_at_[unit] = std::chrono::steady_clock::now();
  ++num_made_;
}

void TileMosaic::Work(std::chrono::steady_clock::time_point until) {
  TileFile::Changes changes;
  std::vector<TileAddress> looked_at;
  const auto put = [&] {
    if (changes.tiles.empty()) return;
    file_->Put(changes);
    is_coarser_stale_ = true;
    for (const auto& [unit, text] : changes.notes) {
      const auto recipe = TileRecipe::FromText(text);
      recipe ? static_cast<void>(made_[unit] = *recipe) : static_cast<void>(made_.erase(unit));
    }
  };
  try {
    do {
      const std::optional<TileAddress> unit = Next();
      if (!unit) break;
      const auto begin = std::chrono::steady_clock::now();
      if (!IsDone(*unit)) Make(*unit, &changes);
      const auto end = std::chrono::steady_clock::now();
      if (made_.contains(*unit) && !urgent_.contains(*unit)) {
        const std::chrono::duration<double> pause = (1 / options_.remake_share - 1) * (end - begin);
        next_remake_ = end + std::chrono::duration_cast<std::chrono::steady_clock::duration>(pause);
      }
      pending_.erase(*unit);
      urgent_.erase(*unit);
    } while (std::chrono::steady_clock::now() < until);
  } catch (...) {
    put();
    throw;
  }
  put();
  UpdateCoarser();
}

// Each of them is part of many finer ones: not with each of these.
bool TileMosaic::MayUpdateCoarser() const {
  constexpr auto kInterval = std::chrono::seconds(2);
  if (!is_coarser_stale_ || scene_.zoom == 0) return false;
  return pending_.empty() || std::chrono::steady_clock::now() - coarser_updated_ >= kInterval;
}

void TileMosaic::UpdateCoarser() {
  if (!MayUpdateCoarser()) return;
  file_->UpdateCoarser(std::max(0, scene_.zoom - options_.num_zooms + 1));
  is_coarser_stale_ = false;
  coarser_updated_ = std::chrono::steady_clock::now();
}

}  // namespace mapmend

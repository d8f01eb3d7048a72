#include "libs/mosaic/tile_recipe.h"

#include <algorithm>
#include <bit>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

namespace mapmend {
namespace {

// FNV-1a (G. Fowler, L. Noll, K.-P. Vo), 64 bits.
class Fingerprint {
 public:
  void Add(const std::string& text) {
    for (const char c : text) AddByte(static_cast<uint8_t>(c));
    AddByte(0);
  }
  void Add(double value) {
    const auto bits = std::bit_cast<uint64_t>(value);
    for (int i = 0; i < 8; ++i) AddByte(static_cast<uint8_t>(bits >> (8 * i)));
  }
  uint64_t Value() const { return value_; }

 private:
  void AddByte(uint8_t byte) {
    constexpr uint64_t kPrime = 1099511628211ULL;
    value_ = (value_ ^ byte) * kPrime;
  }
  uint64_t value_ = 14695981039346656037ULL;
};

void AddImage(const GroundScene& scene, int index, Fingerprint* fingerprint) {
  const MosaicImage& image = scene.Image(index);
  const Camera& camera = image.camera;
  fingerprint->Add(scene.Weight(index));
  for (const double value : {static_cast<double>(camera.model), static_cast<double>(camera.width),
                             static_cast<double>(camera.height), camera.fx, camera.fy, camera.cx, camera.cy})
    fingerprint->Add(value);
  for (const double value : camera.distortion) fingerprint->Add(value);
  for (const double value : ToArray(image.cam_from_ground)) fingerprint->Add(value);
  for (const Eigen::Vector3d& moved : {image.motion.shift, image.motion.turn}) {
    for (int i = 0; i < 3; ++i) fingerprint->Add(moved[i]);
  }
  if (scene.GetExposure().gains.empty()) return;
  for (const float gain : scene.GetExposure().gains[static_cast<size_t>(index)]) fingerprint->Add(gain);
}

// Places all over a unit and its margin, `count` along each side, the corners among them.
std::vector<Eigen::Vector2d> PlacesOf(const GroundBounds& bounds, int count) {
  std::vector<Eigen::Vector2d> places;
  for (int row = 0; row < count; ++row) {
    for (int column = 0; column < count; ++column)
      places.emplace_back(bounds.low + (bounds.Size().array() * Eigen::Array2d(column, row) / (count - 1)).matrix());
  }
  return places;
}

// What the seams' width adds to a unit on each side, of its size.
GroundBounds WithMargin(GroundBounds bounds) {
  constexpr double kMargin = 0.2;
  const Eigen::Vector2d margin = kMargin * bounds.Size();
  bounds.low -= margin;
  bounds.high += margin;
  return bounds;
}

// The best image of a place, and how well it shows it.
struct Best {
  int component = -1, image = -1;
  double quality = 0;
};

double QualityOf(const GroundScene& scene, int image, const Eigen::Vector2d& place) {
  if (!Contains(scene.Footprint(image), place)) return 0;
  const auto sight = scene.View(image).See(scene.OnSurface(place));
  return sight ? scene.Weight(image) * scene.View(image).Quality(sight->steepness, sight->inside) : 0;
}

Best BestAt(const TileScene& scene, const std::vector<std::vector<int>>& near, const Eigen::Vector2d& place) {
  Best best;
  for (size_t c = 0; c < near.size() && best.image < 0; ++c) {
    for (const int image : near[c]) {
      const double quality = QualityOf(scene.components[c].scene, image, place);
      if (quality > best.quality) best = {static_cast<int>(c), image, quality};
    }
  }
  return best;
}

std::vector<std::vector<int>> NearOf(const TileScene& scene, const GroundBounds& bounds) {
  std::vector<std::vector<int>> near;
  for (const TileComponent& component : scene.components) near.push_back(component.scene.Near(bounds));
  return near;
}

constexpr int kChecked = 9;  // places along a side at which images are compared

TileRecipe::Image Describe(const TileScene& scene, const TileAddress& unit, const Best& best) {
  const TileComponent& component = scene.components[static_cast<size_t>(best.component)];
  TileRecipe::Image image;
  image.id = component.scene.Image(best.image).id;
  image.component = component.name;
  const Exposure& exposure = component.scene.GetExposure();
  if (!exposure.gains.empty()) image.gains = exposure.gains[static_cast<size_t>(best.image)];
  const std::vector<Eigen::Vector2d> places = PlacesOf(scene.plane.ToGround(BoundsOf(unit)), 3);
  for (size_t i = 0; i < places.size(); ++i) {
    const auto sight = component.scene.View(best.image).Project(component.scene.OnSurface(places[i]));
    image.pixels[i] = sight ? Eigen::Vector2f(sight->pixel.cast<float>()) : Eigen::Vector2f(-1, -1);
  }
  return image;
}

// Whether an image shows the unit as it did: in place and brightness.
bool IsUnmoved(const TileRecipe::Image& made, const TileRecipe::Image& now, const GroundScene& scene, int index,
               const RecipeTolerance& tolerance) {
  if (made.component != now.component) return false;
  for (size_t c = 0; c < made.gains.size(); ++c) {
    if (std::abs(now.gains[c] / made.gains[c] - 1) > tolerance.gain) return false;
  }
  const Camera& camera = scene.Image(index).camera;
  for (size_t i = 0; i < made.pixels.size(); ++i) {
    const Eigen::Vector2f& pixel = now.pixels[i];
    const bool is_inside = pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < static_cast<float>(camera.width) &&
                           pixel.y() < static_cast<float>(camera.height);
    if (is_inside && (pixel - made.pixels[i]).norm() > tolerance.pixels) return false;
  }
  return true;
}

}  // namespace

TileRecipe MakeRecipe(const TileScene& scene, const TileAddress& unit) {
  TileRecipe recipe;
  const GroundBounds bounds = scene.plane.ToGround(BoundsOf(unit)), wide = WithMargin(bounds);
  const std::vector<std::vector<int>> near = NearOf(scene, wide);
  Fingerprint fingerprint;
  for (size_t c = 0; c < near.size(); ++c) {
    if (near[c].empty()) continue;
    const TileComponent& component = scene.components[c];
    fingerprint.Add(component.name);
    fingerprint.Add(component.is_joined ? 1 : 0);
    fingerprint.Add(component.scene.GetExposure().a);
    fingerprint.Add(component.scene.GetExposure().b);
    for (const int image : near[c]) AddImage(component.scene, image, &fingerprint);
    constexpr int kHeights = 40;
    for (const Eigen::Vector2d& place : PlacesOf(wide, kHeights))
      fingerprint.Add(component.scene.Surface().Height(place.x(), place.y()));
  }
  recipe.fingerprint = fingerprint.Value();
  std::set<std::pair<int, int>> shown;
  for (const Eigen::Vector2d& place : PlacesOf(bounds, kChecked)) {
    const Best best = BestAt(scene, near, place);
    if (best.image >= 0 && shown.insert({best.component, best.image}).second)
      recipe.images.push_back(Describe(scene, unit, best));
  }
  return recipe;
}

bool IsGoodEnough(const TileScene& scene, const TileAddress& unit, const TileRecipe& made,
                  const RecipeTolerance& tolerance) {
  const GroundBounds bounds = scene.plane.ToGround(BoundsOf(unit));
  const std::vector<std::vector<int>> near = NearOf(scene, bounds);
  // The images that the unit was made of, where they are now.
  std::vector<std::pair<int, int>> shown;
  for (const TileRecipe::Image& image : made.images) {
    bool is_there = false;
    for (size_t c = 0; c < near.size() && !is_there; ++c) {
      const GroundScene& of_component = scene.components[c].scene;
      for (const int index : near[c]) {
        if (of_component.Image(index).id != image.id) continue;
        const Best best{static_cast<int>(c), index, 0};
        if (!IsUnmoved(image, Describe(scene, unit, best), of_component, index, tolerance)) return false;
        shown.emplace_back(best.component, index);
        is_there = true;
        break;
      }
    }
    if (!is_there) return false;
  }
  int num_better = 0;
  for (const Eigen::Vector2d& place : PlacesOf(bounds, kChecked)) {
    const Best best = BestAt(scene, near, place);
    if (best.image < 0) continue;
    double quality = 0;
    for (const auto& [component, image] : shown) {
      if (component == best.component)
        quality = std::max(quality, QualityOf(scene.components[static_cast<size_t>(component)].scene, image, place));
    }
    if (quality == 0) return false;  // ground that was not seen before, or only by another part of the map
    if (best.quality > tolerance.quality * quality) ++num_better;
  }
  return num_better <= tolerance.share * kChecked * kChecked;
}

std::string TileRecipe::ToText() const {
  nlohmann::json json = {{"fingerprint", fingerprint}, {"images", nlohmann::json::array()}};
  for (const Image& image : images) {
    nlohmann::json pixels = nlohmann::json::array();
    for (const Eigen::Vector2f& pixel : image.pixels) pixels.insert(pixels.end(), {pixel.x(), pixel.y()});
    json["images"].push_back(
        {{"id", image.id}, {"component", image.component}, {"gains", image.gains}, {"pixels", pixels}});
  }
  return json.dump();
}

std::optional<TileRecipe> TileRecipe::FromText(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  try {
    TileRecipe recipe;
    recipe.fingerprint = json.at("fingerprint").get<uint64_t>();
    for (const nlohmann::json& entry : json.at("images")) {
      Image image;
      image.id = entry.at("id").get<int>();
      image.component = entry.at("component").get<std::string>();
      image.gains = entry.at("gains").get<std::array<float, 3>>();
      const auto pixels = entry.at("pixels").get<std::array<float, 18>>();
      for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = {pixels[2 * i], pixels[2 * i + 1]};
      recipe.images.push_back(std::move(image));
    }
    return recipe;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace mapmend

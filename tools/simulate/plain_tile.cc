// Tiles of the image that show nothing but even ground or one face: rays at the corners only, inverse depth between
// them.
#include <cmath>
#include <cstring>
#include <optional>

#include "tools/simulate/renderer.h"

namespace mapmend::simulate {
namespace {

// False if nothing grows between the four corners, by a look at a level coarse enough that they are neighbours.
bool Grows(const Texture& texture, int level, const double* u, const double* v) {
  level = std::min(level + 4, texture.NumLevels() - 1);
  const Image& image = texture.Level(level);
  const double scale = std::ldexp(1.0, -level);
  const auto [low_u, high_u] = std::minmax({u[0], u[1], u[2], u[3]});
  const auto [low_v, high_v] = std::minmax({v[0], v[1], v[2], v[3]});
  const auto cell = [scale](double texel, int count) {
    return std::clamp(static_cast<int>((texel + 0.5) * scale), 0, count - 1);
  };
  for (int j = cell(low_v - 1, image.height); j <= cell(high_v + 1, image.height); ++j) {
    for (int i = cell(low_u - 1, image.width); i <= cell(high_u + 1, image.width); ++i) {
      if (image.At(i, j) >> 24 != 0) return true;
    }
  }
  return false;
}

// One level of leaves under a tile: the cells are computed once, then read by every pixel.
class TileLeaves {
 public:
  // u, v: corners of the tile; origin: what coordinates given to At are relative to. False if there are too many cells.
  bool Fill(const double* u, const double* v, double origin_u, double origin_v, double repeat, int level, float weight,
            const CanopyView& view) {
    const double scale = std::ldexp(1.0, -level);
    const double shift = repeat > 0 ? repeat * std::floor(origin_u / repeat) : 0;
    const auto cell = [scale](double texel) { return (texel + 0.5) * scale - 0.5; };
    const auto [low_u, high_u] = std::minmax({u[0], u[1], u[2], u[3]});
    const auto [low_v, high_v] = std::minmax({v[0], v[1], v[2], v[3]});
    const double first_i = std::floor(cell(low_u - shift) - 0.01), first_j = std::floor(cell(low_v) - 0.01);
    if (cell(high_u - shift) - first_i > 1000 || cell(high_v) - first_j > 1000) return false;
    scale_ = static_cast<float>(scale);
    u_ = static_cast<float>(cell(origin_u - shift) - first_i);
    v_ = static_cast<float>(cell(origin_v) - first_j);
    return Fill(static_cast<int>(first_i), static_cast<int>(first_j),
                static_cast<int>(cell(high_u - shift) - first_i) + 3, static_cast<int>(cell(high_v) - first_j) + 3,
                level, weight, view);
  }
  // Adds the next coarser level, at the places of this one's cells.
  void AddCoarser(int level, float weight, const CanopyView& view) {
    TileLeaves coarse;
    coarse.FillUnder(*this, level, weight, view);
    Add(coarse);
  }
  // The same with the one after that.
  void AddCoarser(int level, float weight, float next_weight, const CanopyView& view) {
    TileLeaves coarse;
    coarse.FillUnder(*this, level, weight, view);
    coarse.AddCoarser(level + 1, next_weight, view);
    Add(coarse);
  }
  LeafCells Cells() const { return {cells_, stride_, scale_, u_, v_}; }

 private:
  static constexpr int kCells = 3072;

  bool Fill(int i, int j, int columns, int rows, int level, float weight, const CanopyView& view) {
    i_ = i, j_ = j, columns_ = columns, rows_ = rows, stride_ = (columns + 7) & ~7;
    if (stride_ * rows > kCells) return false;
    FillCanopy(i, j, rows, stride_, level, weight, view, cells_);
    return true;
  }
  // What AddCoarser needs of the coarser level: it has fewer cells, so there is room.
  void FillUnder(const TileLeaves& fine, int level, float weight, const CanopyView& view) {
    const int i = (fine.i_ >> 1) - 1, j = (fine.j_ >> 1) - 1;
    Fill(i, j, ((fine.i_ + fine.columns_) >> 1) + 2 - i, ((fine.j_ + fine.rows_) >> 1) + 2 - j, level, weight, view);
  }
  // A cell lies a quarter of a coarse cell's size from the middle of the one that contains it.
  void Add(const TileLeaves& coarse) {
    for (int j = 0; j < rows_; ++j) {
      const int y = j_ + j;
      const float* near = coarse.cells_ + ((y >> 1) - coarse.j_) * coarse.stride_ - coarse.i_;
      const float* far = near + ((y & 1) != 0 ? coarse.stride_ : -coarse.stride_);
      float* row = cells_ + j * stride_;
      const auto mean = [near, far](int x) { return 0.75f * near[x] + 0.25f * far[x]; };
      const auto add = [&](int i) {
        const int x = (i_ + i) >> 1, other = ((i_ + i) & 1) != 0 ? x + 1 : x - 1;
        row[i] += 0.75f * mean(x) + 0.25f * mean(other);
      };
      int i = 0;
      if ((i_ & 1) != 0) add(i++);
      // Eight at a time, above four coarse cells and between their neighbours.
      for (; i + 8 <= columns_; i += 8) {
        const auto means = [near, far](int x) {
          Color a, b;
          std::memcpy(&a, near + x, sizeof a);
          std::memcpy(&b, far + x, sizeof b);
          return 0.75f * a + 0.25f * b;
        };
        const int x = (i_ + i) >> 1;
        const Color middle = 0.75f * means(x), left = middle + 0.25f * means(x - 1),
                    right = middle + 0.25f * means(x + 1);
        const Color halves[2] = {__builtin_shuffle(left, right, Int4{0, 4, 1, 5}),
                                 __builtin_shuffle(left, right, Int4{2, 6, 3, 7})};
        for (int h = 0; h < 2; ++h) {
          Color cells;
          std::memcpy(&cells, row + i + 4 * h, sizeof cells);
          cells += halves[h];
          std::memcpy(row + i + 4 * h, &cells, sizeof cells);
        }
      }
      for (; i < columns_; ++i) add(i);
    }
  }

  float cells_[kCells];
  int i_, j_, columns_, rows_, stride_;
  float scale_, u_, v_;
};

}  // namespace

Eigen::Vector4d Renderer::PlainTile::Between(const Eigen::Vector3d* points, double a, double b) const {
  const double w[] = {(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b};
  Eigen::Vector4d value = Eigen::Vector4d::Zero();
  for (int k = 0; k < 4; ++k)
    value += w[k] * inverse[k] * Eigen::Vector4d(points[k].x(), points[k].y(), points[k].z(), 1);
  return value;
}

bool Renderer::IsEvenGround(const PlainTile& tile, const Eigen::Vector3d* points, bool large) const {
  if (scene_->IsFlat(points, 2e-4 / tile.inverse[0])) return true;
  if (large) return false;
  for (const auto& [a, b] : {std::pair{0.5, 0.5}, {0.5, 0.0}, {0.5, 1.0}, {0.0, 0.5}, {1.0, 0.5}}) {
    const Eigen::Vector4d p = tile.Between(points, a, b);
    const Eigen::Vector3d world = p.head<3>() / p[3];
    if (std::abs(world.z() - scene_->grid.Height(world.x(), world.y())) > 2e-4 / p[3]) return false;
  }
  return true;
}

// hits: upper left, lower left, upper right, lower right.
bool Renderer::FillPlainTile(int x0, int y0, int x1, int y1, int x_end, int y_end, const Beam& beam, const Hit* hits) {
  const int surface = hits[0].surface;
  if (x1 == x0 || y1 == y0 || surface == Hit::kNothing || beam.height > 1e29) return false;
  for (int k = 0; k < 4; ++k) {
    if (hits[k].surface != surface || (surface == Hit::kGround && hits[k].slope > 0.7f)) return false;
  }
  const bool large = x_end - x0 > kTile;
  const int width = camera_.width;
  const int xs[] = {x0, x0, x1, x1}, ys[] = {y0, y1, y0, y1};
  Eigen::Vector3d points[4], directions[4];
  PlainTile tile{x0, y0, x1, y1, x_end, y_end, surface, nullptr, Color{1, 1, 1, 1}, {}, {}, 0, {}, {}, false};
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3f& ray = rays_[static_cast<size_t>(ys[k]) * width + xs[k]];
    directions[k] = rows_[ys[k]].rotation * ray.cast<double>();
    points[k] = rows_[ys[k]].center + hits[k].distance * directions[k];
    tile.inverse[k] = 1 / (hits[k].distance * ray.z());
  }
  if (!scene_->IsClear(beam, points, directions, surface)) return false;
  const double footprint =
      0.25 * (hits[0].distance + hits[1].distance + hits[2].distance + hits[3].distance) * pixel_angle_;
  double texel_width = 0, cosine = 1;
  if (surface == Hit::kGround) {
    if (!IsEvenGround(tile, points, large)) return false;
    const double texels = scene_->ground_texels_per_metre;
    texel_width = footprint * texels;
    cosine = -std::max(directions[0].z(), directions[3].z());
    tile.foliage = scene_->foliage;
    tile.leaves = scene_->LeavesSeen(directions[0] + directions[3], time_);
    tile.texture = scene_->ground.get();
    tile.near = scene_->detail != nullptr && DetailLook::kFading * texel_width * DetailLook::kFirst < 1;
    for (int k = 0; k < 4; ++k) {
      tile.u[k] = (points[k].x() - scene_->grid.x0) * texels - 0.5;
      tile.v[k] = (points[k].y() - scene_->grid.y0) * texels - 0.5;
    }
  } else {
    const Face& face = scene_->solids[(surface - 1) / 8].faces[(surface - 1) % 8];
    texel_width = footprint * face.texels_per_metre;
    cosine = -std::max(face.normal.dot(directions[0]), face.normal.dot(directions[3]));
    if (face.texture >= 0) tile.texture = scene_->textures[face.texture].get();
    tile.tint = face.color;
    for (int k = 0; k < 4; ++k) {
      tile.u[k] = face.u.dot(points[k]) + face.u0;
      tile.v[k] = face.v.dot(points[k]) + face.v0;
    }
  }
  if (tile.texture != nullptr && cosine > 0.7 &&
      PaintPlainTile(tile, static_cast<float>(std::log2(std::max(texel_width, 1e-3)))))
    return true;
  if (large) return false;
  ShadePlainTile(tile, points, (directions[0] + directions[3]).normalized(), footprint / pixel_angle_);
  return true;
}

void Renderer::ShadePlainTile(const PlainTile& tile, const Eigen::Vector3d* points, const Eigen::Vector3d& view,
                              double distance) {
  std::optional<GroundLook> look;
  if (tile.surface == Hit::kGround && tile.x_end - tile.x0 == kTile && CanShadeRows(view))
    look = LookOfGround(view, distance);
  for (int y = tile.y0; y < tile.y_end; ++y) {
    const double b = static_cast<double>(y - tile.y0) / (tile.y1 - tile.y0);
    Eigen::Vector4d p = tile.Between(points, 0, b);
    const Eigen::Vector4d step = (tile.Between(points, 1, b) - p) / (tile.x1 - tile.x0);
    const size_t row = static_cast<size_t>(y) * camera_.width;
    for (int x = tile.x0; x < tile.x_end; ++x, p += step) {
      const Hit hit{ray_stretch_[row + x] / p[3], tile.surface, 0};
      distance_[row + x] = static_cast<float>(hit.distance);
      surface_[row + x] = tile.surface;
      if (look) continue;
      const Eigen::Vector3d direction = rows_[y].rotation * rays_[row + x].cast<double>();
      light_[row + x] = PackLight(scene_->Shade(rows_[y].center, direction, hit, pixel_angle_, time_));
    }
    constexpr float kLevel[kTile] = {};
    if (look)
      RowKernels::Get().shade_ground(*look, WorldOf(y), kLevel, 0xff, PixelsAt(row + tile.x0, kTile, y - tile.y0));
  }
}

bool Renderer::ChooseLevels(const PlainTile& tile, int first, double origin_u, double origin_v, PlainLook* look) {
  for (int l = 0; l < 2; ++l) {
    const int level = first + (look->two ? l : 0);
    const Image& image = tile.texture->Level(level);
    const double scale = std::ldexp(1.0, -level);
    const auto shift = [scale](double origin) { return static_cast<float>((origin + 0.5) * scale - 0.5); };
    look->levels[l] = {image.texels.data(), image.width, static_cast<float>(scale), shift(origin_u), shift(origin_v)};
    for (int k = 0; k < 4; ++k) {
      const double x = (tile.u[k] + 0.5) * scale - 0.5, y = (tile.v[k] + 0.5) * scale - 0.5;
      if (x < 1 || y < 1 || x > image.width - 3 || y > image.height - 3) return false;
    }
  }
  return true;
}

// The texels are asked for now, row by row at both ends, and there when they are needed.
void Renderer::FetchTexels(const PlainTile& tile, const PlainLook& look, int num_levels, double origin_u,
                           double origin_v) {
  for (int l = 0; l < num_levels; ++l) {
    const int rows = tile.y_end - tile.y0;
    for (int side = 0; side < 4; side += 2) {
      const auto at = [&](const double* c, double origin) { return static_cast<float>(c[side] - origin); };
      float u_row = at(tile.u, origin_u) * look.levels[l].scale + look.levels[l].u0,
            v_row = at(tile.v, origin_v) * look.levels[l].scale + look.levels[l].v0;
      const float per_row = look.levels[l].scale / static_cast<float>(rows);
      const float du = static_cast<float>(tile.u[side + 1] - tile.u[side]) * per_row;
      const float dv = static_cast<float>(tile.v[side + 1] - tile.v[side]) * per_row;
      for (int row = 0; row <= rows; ++row, u_row += du, v_row += dv) {
        __builtin_prefetch(look.levels[l].texels + static_cast<int>(v_row) * look.levels[l].width +
                           static_cast<int>(u_row));
      }
    }
  }
}

// Texture lookups four pixels at a time: homogeneous texture coordinates are linear in the pixel.
bool Renderer::PaintPlainTile(const PlainTile& tile, float lod) {
  const Texture& texture = *tile.texture;
  const CanopyLevels canopy(lod);
  lod = std::clamp(lod, 0.f, static_cast<float>(texture.NumLevels() - 1));
  const int first = static_cast<int>(lod);
  const float fraction = lod - static_cast<float>(first);
  const bool two = fraction >= 0.02f && first + 1 < texture.NumLevels();
  // Coordinates relative to the tile, so that single precision is enough.
  const double origin_u = std::floor(tile.u[0]), origin_v = std::floor(tile.v[0]);
  double u[4], v[4];
  PlainLook look;
  look.two = two;
  look.part = static_cast<int16_t>(fraction * 32767.f);
  look.tint = tile.tint;
  look.surface = tile.surface;
  if (!ChooseLevels(tile, first, origin_u, origin_v, &look)) return false;
  FetchTexels(tile, look, two ? 2 : 1, origin_u, origin_v);
  TileLeaves leaves[2];
  const bool grows = tile.foliage > 0 && Grows(texture, first, tile.u, tile.v);
  if (grows) {
    const float contrast = tile.foliage * (1.f / 255);
    for (int l = 0; l < 2; ++l) {
      if (!leaves[l].Fill(tile.u, tile.v, origin_u, origin_v, scene_->ground_repeat, canopy.first + l,
                          canopy.weight[l] * contrast, tile.leaves))
        return false;
    }
    look.leaves[0] = leaves[0].Cells(), look.leaves[1] = leaves[1].Cells();
    leaves[1].AddCoarser(canopy.first + 2, canopy.weight[2] * contrast, canopy.weight[3] * contrast, tile.leaves);
  }
  for (int k = 0; k < 4; ++k) {
    u[k] = (tile.u[k] - origin_u) * tile.inverse[k];
    v[k] = (tile.v[k] - origin_v) * tile.inverse[k];
  }
  look.grows = grows;
  DetailLook detail;
  if (tile.near) detail = scene_->Detail(origin_u, origin_v);
  const auto texel_angle = static_cast<float>(pixel_angle_ * scene_->ground_texels_per_metre);
  const int width = camera_.width;
  const RowKernels& kernels = RowKernels::Get();
  for (int y = tile.y0; y < tile.y_end; ++y) {
    const double b = static_cast<double>(y - tile.y0) / (tile.y1 - tile.y0), per_pixel = 1.0 / (tile.x1 - tile.x0);
    const auto line = [&](const double* corners, float* start, float* step) {
      const double left = corners[0] + (corners[1] - corners[0]) * b,
                   right = corners[2] + (corners[3] - corners[2]) * b;
      *start = static_cast<float>(left);
      *step = static_cast<float>((right - left) * per_pixel);
    };
    PlainRow row;
    line(u, &row.u, &row.du);
    line(v, &row.v, &row.dv);
    line(tile.inverse, &row.inverse, &row.inverse_step);
    for (int x = tile.x0; x < tile.x_end; x += 8) {
      const size_t i = static_cast<size_t>(y) * width + x;
      const PixelRow pixels = PixelsAt(i, std::min(8, tile.x_end - x), y - tile.y0);
      kernels.paint_plain(look, row, x - tile.x0, pixels);
      if (tile.near) kernels.add_detail(detail, texel_angle, row, x - tile.x0, pixels);
    }
  }
  return true;
}

}  // namespace mapmend::simulate

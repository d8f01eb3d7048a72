// Tiles of the image that show nothing but even ground or one face: rays at the corners only, inverse depth between
// them.
#include <cmath>

#include "procs/simulate/renderer.h"

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
    const int columns = static_cast<int>(cell(high_u - shift) - first_i) + 3;
    const int rows = static_cast<int>(cell(high_v) - first_j) + 3;
    stride_ = (columns + 7) & ~7;
    if (columns > 1000 || rows > 1000 || stride_ * rows > kCells) return false;
    scale_ = static_cast<float>(scale);
    u_ = static_cast<float>(cell(origin_u - shift) - first_i);
    v_ = static_cast<float>(cell(origin_v) - first_j);
    FillCanopy(static_cast<int>(first_i), static_cast<int>(first_j), rows, stride_, level, weight, view, cells_);
    return true;
  }
  // Bilinear, at the first `count` of four points.
  Color At(const Color& u, const Color& v, int count) const {
    const Color x = u * scale_ + u_, y = v * scale_ + v_;
    const Int4 i = __builtin_convertvector(x, Int4), j = __builtin_convertvector(y, Int4);
    const Color a = x - __builtin_convertvector(i, Color), b = y - __builtin_convertvector(j, Color);
    Color c00 = {}, c10 = {}, c01 = {}, c11 = {};
    for (int k = 0; k < count; ++k) {
      const float* c = cells_ + j[k] * stride_ + i[k];
      c00[k] = c[0], c10[k] = c[1], c01[k] = c[stride_], c11[k] = c[stride_ + 1];
    }
    const Color top = c00 + (c10 - c00) * a, bottom = c01 + (c11 - c01) * a;
    return top + (bottom - top) * b;
  }

 private:
  static constexpr int kCells = 2048;

  float cells_[kCells];
  int stride_;
  float scale_, u_, v_;
};

}  // namespace

// hits: upper left, lower left, upper right, lower right.
bool Renderer::FillPlainTile(int x0, int y0, int x1, int y1, int x_end, int y_end, const Beam& beam, const Hit* hits) {
  const int surface = hits[0].surface;
  if (x1 == x0 || y1 == y0 || surface == Hit::kNothing || beam.height > 1e29) return false;
  for (int k = 0; k < 4; ++k) {
    if (hits[k].surface != surface || (surface == Hit::kGround && hits[k].slope > 0.7f)) return false;
  }
  const int width = camera_.width;
  const int xs[] = {x0, x0, x1, x1}, ys[] = {y0, y1, y0, y1};
  Eigen::Vector3d points[4], directions[4];
  PlainTile tile{x0, y0, x1, y1, x_end, y_end, surface, nullptr, Color{1, 1, 1, 1}, {}, {}, 0, {}, {}};
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3f& ray = rays_[static_cast<size_t>(ys[k]) * width + xs[k]];
    directions[k] = rows_[ys[k]].rotation * ray.cast<double>();
    points[k] = rows_[ys[k]].center + hits[k].distance * directions[k];
    tile.inverse[k] = 1 / (hits[k].distance * ray.z());
  }
  if (!scene_->IsClear(beam, points, directions, surface)) return false;
  // World and inverse depth by weights of the four corners.
  const auto at = [&](double a, double b) {
    const double w[] = {(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b};
    Eigen::Vector4d value = Eigen::Vector4d::Zero();
    for (int k = 0; k < 4; ++k)
      value += w[k] * tile.inverse[k] * Eigen::Vector4d(points[k].x(), points[k].y(), points[k].z(), 1);
    return value;
  };
  const double footprint =
      0.25 * (hits[0].distance + hits[1].distance + hits[2].distance + hits[3].distance) * pixel_angle_;
  double texel_width = 0, cosine = 1;
  if (surface == Hit::kGround) {
    for (const auto& [a, b] : {std::pair{0.5, 0.5}, {0.5, 0.0}, {0.5, 1.0}, {0.0, 0.5}, {1.0, 0.5}}) {
      const Eigen::Vector4d p = at(a, b);
      const Eigen::Vector3d world = p.head<3>() / p[3];
      if (std::abs(world.z() - scene_->grid.Height(world.x(), world.y())) > 2e-4 / p[3]) return false;
    }
    const double texels = scene_->ground_texels_per_metre;
    texel_width = footprint * texels;
    cosine = -std::max(directions[0].z(), directions[3].z());
    tile.foliage = scene_->foliage;
    tile.leaves = scene_->LeavesSeen(directions[0] + directions[3], time_);
    if (scene_->detail == nullptr || texel_width > 0.53) tile.texture = scene_->ground.get();
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
  for (int y = y0; y < y_end; ++y) {
    const double b = static_cast<double>(y - y0) / (y1 - y0);
    Eigen::Vector4d p = at(0, b);
    const Eigen::Vector4d step = (at(1, b) - p) / (x1 - x0);
    const size_t row = static_cast<size_t>(y) * width;
    for (int x = x0; x < x_end; ++x, p += step) {
      const Hit hit{ray_stretch_[row + x] / p[3], surface, 0};
      distance_[row + x] = static_cast<float>(hit.distance);
      surface_[row + x] = surface;
      const Eigen::Vector3d direction = rows_[y].rotation * rays_[row + x].cast<double>();
      light_[row + x] = PackLight(scene_->Shade(rows_[y].center, direction, hit, pixel_angle_, time_));
    }
  }
  return true;
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
  struct View {
    const uint32_t* texels;
    int width;
    float scale, u, v;  // texel of the level = (relative coordinate) * scale + (u, v)
  } views[2];
  for (int l = 0; l < 2; ++l) {
    const int level = first + (two ? l : 0);
    const Image& image = texture.Level(level);
    const double scale = std::ldexp(1.0, -level);
    const auto shift = [scale](double origin) { return static_cast<float>((origin + 0.5) * scale - 0.5); };
    views[l] = {image.texels.data(), image.width, static_cast<float>(scale), shift(origin_u), shift(origin_v)};
    for (int k = 0; k < 4; ++k) {
      const double x = (tile.u[k] + 0.5) * scale - 0.5, y = (tile.v[k] + 0.5) * scale - 0.5;
      if (x < 1 || y < 1 || x > image.width - 3 || y > image.height - 3) return false;
    }
  }
  TileLeaves leaves[4];
  int num_leaves = 0;
  for (int l = 0; l < 4 && tile.foliage > 0 && Grows(texture, first, tile.u, tile.v); ++l) {
    if (canopy.weight[l] <= 0.02f) continue;
    if (!leaves[num_leaves++].Fill(tile.u, tile.v, origin_u, origin_v, scene_->ground_repeat, canopy.first + l,
                                   canopy.weight[l] * tile.foliage * (1.f / 255), tile.leaves))
      return false;
  }
  for (int k = 0; k < 4; ++k) {
    u[k] = (tile.u[k] - origin_u) * tile.inverse[k];
    v[k] = (tile.v[k] - origin_v) * tile.inverse[k];
  }
  const int width = camera_.width;
  const Color ramp = {0, 1, 2, 3};
  for (int y = tile.y0; y < tile.y_end; ++y) {
    const double b = static_cast<double>(y - tile.y0) / (tile.y1 - tile.y0), per_pixel = 1.0 / (tile.x1 - tile.x0);
    const auto line = [&](const double* corners, float* start, float* step) {
      const double left = corners[0] + (corners[1] - corners[0]) * b,
                   right = corners[2] + (corners[3] - corners[2]) * b;
      *start = static_cast<float>(left);
      *step = static_cast<float>((right - left) * per_pixel);
    };
    float u0, du, v0, dv, w0, dw;
    line(u, &u0, &du);
    line(v, &v0, &dv);
    line(tile.inverse, &w0, &dw);
    for (int x = tile.x0; x < tile.x_end; x += 4) {
      const Color at = ramp + static_cast<float>(x - tile.x0);
      const Color depth = 1.f / (w0 + dw * at);
      const Color tu = (u0 + du * at) * depth, tv = (v0 + dv * at) * depth;
      Int4 index[2];
      Color fu[2], fv[2];
      for (int l = 0; l < (two ? 2 : 1); ++l) {
        const Color lu = tu * views[l].scale + views[l].u, lv = tv * views[l].scale + views[l].v;
        const Int4 iu = __builtin_convertvector(lu, Int4), iv = __builtin_convertvector(lv, Int4);
        fu[l] = lu - __builtin_convertvector(iu, Color);
        fv[l] = lv - __builtin_convertvector(iv, Color);
        index[l] = iv * views[l].width + iu;
      }
      const int count = std::min(4, tile.x_end - x);
      Color rustle = {};
      for (int l = 0; l < num_leaves; ++l) rustle += leaves[l].At(tu, tv, count);
      const size_t i = static_cast<size_t>(y) * width + x;
      for (int k = 0; k < count; ++k) {
        const auto sample = [&](int l) {
          const uint32_t* t = views[l].texels + index[l][k];
          const uint32_t* below = t + views[l].width;
          const Color left = Unpack(t[0]) + (Unpack(below[0]) - Unpack(t[0])) * fv[l][k];
          const Color right = Unpack(t[1]) + (Unpack(below[1]) - Unpack(t[1])) * fv[l][k];
          return left + (right - left) * fu[l][k];
        };
        Color color = sample(0);
        if (two) color += (sample(1) - color) * fraction;
        if (num_leaves > 0) color *= 1.f + color[3] * rustle[k];
        light_[i + k] = PackLight(color * tile.tint);
        distance_[i + k] = depth[k] * ray_stretch_[i + k];
        surface_[i + k] = tile.surface;
      }
    }
  }
  return true;
}

}  // namespace mapmend::simulate

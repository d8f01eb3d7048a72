// Tiles of the image that show edges or uneven ground: rays for every second pixel, for every one where these tell of
// an edge between them; then the colours of the whole tile.
#include <cmath>

#include "procs/simulate/renderer.h"

namespace mapmend::simulate {

void Renderer::CastTile(int x0, int y0, int x1, int y1, const Beam& beam, const Hit* hits) {
  const int x_end = std::min(x0 + kTile, camera_.width), y_end = std::min(y0 + kTile, camera_.height);
  if (x1 - x0 != kTile || y1 - y0 != kTile || beam.height > 1e29) {
    for (int y = y0; y < y_end; ++y) {
      for (int x = x0; x < x_end; ++x) CastPixel(x, y, beam);
    }
    return;
  }
  constexpr int kNodes = kTile / 2 + 1;
  Hit nodes[kNodes][kNodes];  // by row and column
  float inverse[kNodes][kNodes];
  const auto cast = [&](int x, int y) { return scene_->Cast(rows_[y].center, Direction(x, y), beam); };
  for (int j = 0; j < kNodes; ++j) {
    for (int i = 0; i < kNodes; ++i) {
      const int x = x0 + 2 * i, y = y0 + 2 * j;
      const bool corner = i % (kNodes - 1) == 0 && j % (kNodes - 1) == 0;
      nodes[j][i] = corner ? hits[2 * (i != 0) + (j != 0)] : cast(x, y);
      const size_t k = static_cast<size_t>(y) * camera_.width + x;
      inverse[j][i] = ray_stretch_[k] / static_cast<float>(nodes[j][i].distance);
    }
  }
  UnevenTile tile{x0, y0, {}};
  const auto set = [&](int i, int j, float distance, int surface, float slope) {
    tile.slope[j][i] = slope;
    const size_t k = static_cast<size_t>(y0 + j) * camera_.width + x0 + i;
    distance_[k] = distance;
    surface_[k] = surface;
  };
  for (int j = 0; j + 1 < kNodes; ++j) {
    for (int i = 0; i + 1 < kNodes; ++i) {
      const Hit& node = nodes[j][i];
      set(2 * i, 2 * j, static_cast<float>(node.distance), node.surface, node.slope);
      // One surface all around, and no jump between the four pixels.
      bool even = node.surface != Hit::kNothing;
      for (int b = std::max(j - 1, 0); b <= std::min(j + 2, kNodes - 1); ++b) {
        for (int a = std::max(i - 1, 0); a <= std::min(i + 2, kNodes - 1); ++a)
          even &= nodes[b][a].surface == node.surface;
      }
      const float w00 = inverse[j][i], w10 = inverse[j][i + 1], w01 = inverse[j + 1][i], w11 = inverse[j + 1][i + 1];
      even &= std::abs(w00 + w11 - w10 - w01) < 3e-3f * w00;
      const std::pair<int, int> rest[] = {{1, 0}, {0, 1}, {1, 1}};
      const float between[] = {0.5f * (w00 + w10), 0.5f * (w00 + w01), 0.25f * (w00 + w10 + w01 + w11)};
      for (int k = 0; k < 3; ++k) {
        const int x = 2 * i + rest[k].first, y = 2 * j + rest[k].second;
        const float stretch = ray_stretch_[static_cast<size_t>(y0 + y) * camera_.width + x0 + x];
        Hit between_nodes{stretch / between[k], node.surface, node.slope};
        if (even && (node.surface != Hit::kGround ||
                     scene_->SettleOnGround(rows_[y0 + y].center, Direction(x0 + x, y0 + y), &between_nodes))) {
          set(x, y, static_cast<float>(between_nodes.distance), node.surface, between_nodes.slope);
        } else {
          const Hit hit = cast(x0 + x, y0 + y);
          set(x, y, static_cast<float>(hit.distance), hit.surface, hit.slope);
        }
      }
    }
  }
  ShadeTile(tile);
}

void Renderer::ShadeTile(const UnevenTile& tile) {
  const Eigen::Vector3d view = Direction(tile.x0 + kTile / 2, tile.y0 + kTile / 2);
  // A face seen steeply needs one lookup a pixel, all of the same level of detail.
  int known = Hit::kNothing;
  float face_lod = 0;
  bool simple = false;
  const auto shade = [&](int i, int j) {
    const int x = tile.x0 + i, y = tile.y0 + j;
    const size_t k = static_cast<size_t>(y) * camera_.width + x;
    if (surface_[k] > Hit::kGround) {
      const Face& face = scene_->solids[(surface_[k] - 1) / 8].faces[(surface_[k] - 1) % 8];
      if (surface_[k] != known) {
        known = surface_[k];
        simple = face.texture >= 0 && -face.normal.dot(view) > 0.7;
        face_lod = Log2(std::max(static_cast<float>(distance_[k] * pixel_angle_) * face.texels_per_metre, 1e-6f));
      }
      if (simple) {
        const Eigen::Vector3d point = rows_[y].center + distance_[k] * Direction(x, y);
        const Color texel = scene_->textures[face.texture]->Sample(
            static_cast<float>(face.u.dot(point) + face.u0), static_cast<float>(face.v.dot(point) + face.v0), face_lod);
        light_[k] = PackLight(texel * face.color);
        return;
      }
    }
    const Hit hit{distance_[k], surface_[k], tile.slope[j][i]};
    light_[k] = PackLight(scene_->Shade(rows_[y].center, Direction(x, y), hit, pixel_angle_, time_));
  };
  const size_t middle = static_cast<size_t>(tile.y0 + kTile / 2) * camera_.width + tile.x0 + kTile / 2;
  const double texels = scene_->ground_texels_per_metre, texel_angle = pixel_angle_ * texels;
  // The common case, seen steeply from above and not from near: a pixel needs one lookup, leaves are those of the whole
  // tile's direction and distance.
  const bool steep_view = view.z() < -0.75;
  const bool common =
      steep_view && scene_->foliage > 0 && (scene_->detail == nullptr || distance_[middle] * texel_angle > 0.6);
  const CanopyView leaves = scene_->LeavesSeen(view, time_);
  const CanopyLevels levels(static_cast<float>(std::log2(std::max(distance_[middle] * texel_angle, 1e-3))));
  const Texture& texture = *scene_->ground;
  for (int j = 0; j < kTile; ++j) {
    const int y = tile.y0 + j;
    const size_t row = static_cast<size_t>(y) * camera_.width + tile.x0;
    int ground = 0;
    for (int i = 0; i < kTile; ++i) ground += surface_[row + i] == Hit::kGround;
    if (!common || ground == 0) {
      for (int i = 0; i < kTile; ++i) shade(i, j);
      continue;
    }
    static_assert(kTile == CanopyPoints::kCount);
    CanopyPoints points;
    double xs[kTile], ys[kTile], origin_x = 1e30, origin_y = 1e30;
    for (int i = 0; i < kTile; ++i) {
      const double distance = std::min(distance_[row + i], 1e5f);
      const Eigen::Vector3d point = rows_[y].center + distance * Direction(tile.x0 + i, y);
      xs[i] = (point.x() - scene_->grid.x0) * texels - 0.5;
      ys[i] = (point.y() - scene_->grid.y0) * texels - 0.5;
      points.z[i] = tile.slope[j][i] > 0.7f ? static_cast<float>(point.z() * texels) : 0.f;
      origin_x = std::min(origin_x, xs[i]);
      origin_y = std::min(origin_y, ys[i]);
    }
    for (int i = 0; i < kTile; ++i) {
      points.x[i] = static_cast<float>(xs[i] - origin_x);
      points.y[i] = static_cast<float>(ys[i] - origin_y);
    }
    const double repeat = scene_->ground_repeat;
    const double turns = repeat > 0 ? repeat * std::floor(origin_x / repeat) : 0;
    float brightness[kTile];
    CanopyAt(points, origin_x - turns, origin_y, levels, leaves, brightness);
    for (int i = 0; i < kTile; ++i) {
      if (surface_[row + i] != Hit::kGround) {
        shade(i, j);
        continue;
      }
      const auto width = static_cast<float>(distance_[row + i] * texel_angle);
      const float steep = 0.8f * tile.slope[j][i];
      const float lod = Log2(steep > 1 ? std::max(width, 1.5f * steep) : width);
      Color color = texture.Sample(static_cast<float>(xs[i]), static_cast<float>(ys[i]), lod);
      if (color[3] > 1) color *= 1.f + scene_->foliage * (1.f / 255) * color[3] * brightness[i];
      light_[row + i] = PackLight(color);
    }
  }
}

}  // namespace mapmend::simulate

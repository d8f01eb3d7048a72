// Tiles of the image that show edges or uneven ground: rays for every second pixel, for every one where these tell of
// an edge between them; then the colours of the whole tile.
#include <bit>
#include <cmath>
#include <cstring>

#include "tools/simulate/renderer.h"

namespace mapmend::simulate {

void Renderer::CastTile(int x0, int y0, int x1, int y1, const Beam& beam, const Hit* hits) {
  const int x_end = std::min(x0 + kTile, camera_.width), y_end = std::min(y0 + kTile, camera_.height);
  if (x1 - x0 != kTile || y1 - y0 != kTile || beam.height > 1e29) {
    for (int y = y0; y < y_end; ++y) {
      for (int x = x0; x < x_end; ++x) CastPixel(x, y, beam);
    }
    return;
  }
  UnevenTile tile{x0, y0, {}, {}};
  for (int j = 0; j < kTile; ++j) tile.world[j] = WorldOf(y0 + j);
  // On open ground rays are cast through every fourth pixel at first.
  const bool open = !beam.solids && hits[0].surface == Hit::kGround && hits[1].surface == Hit::kGround &&
                    hits[2].surface == Hit::kGround && hits[3].surface == Hit::kGround;
  TileNodes nodes;
  if (!open || !(CastNodes(x0, y0, 4, beam, hits, &nodes), nodes.Smooth())) CastNodes(x0, y0, 2, beam, hits, &nodes);
  Pending pending;
  const int shift = nodes.step == 4 ? 2 : 1, last = nodes.step - 1;
  for (int j = 0; j < kTile; ++j) {
    // Inverse depths between nodes, and which pixels lie between nodes without a jump.
    const int b = j >> shift;
    float between[kTile];
    nodes.InverseDepths(j, between);
    unsigned even = 0, ground = 0;
    for (int a = 0; a < kTile >> shift; ++a) {
      if (!nodes.even[b][a]) continue;
      const unsigned cell = ((1u << nodes.step) - 1) << (a << shift);
      even |= cell;
      if (nodes.hit[b][a].surface == Hit::kGround) ground |= cell;
    }
    const PixelRow pixels = PixelsAt(static_cast<size_t>(y0 + j) * camera_.width + x0, kTile, j);
    unsigned missed = 0;
    if (ground != 0)
      missed = RowKernels::Get().settle_on_ground(scene_->grid, tile.world[j], between, ground, pixels, tile.slope[j]);
    const auto set = [&](int i, const Hit& hit) {
      pixels.distance[i] = static_cast<float>(hit.distance);
      pixels.surface[i] = hit.surface;
      tile.slope[j][i] = hit.slope;
    };
    const unsigned own = (j & last) != 0 ? 0u : shift == 2 ? 0x11u : 0x55u;
    for (unsigned rest = own; rest != 0; rest &= rest - 1) {
      const int i = std::countr_zero(rest);
      set(i, nodes.hit[b][i >> shift]);
    }
    for (unsigned rest = even & ~ground & ~own; rest != 0; rest &= rest - 1) {
      const int i = std::countr_zero(rest);
      const Hit& near = nodes.hit[b][i >> shift];
      set(i, {pixels.stretch[i] / between[i], near.surface, near.slope});
    }
    for (unsigned rest = (~even | missed) & ~own & 0xffu; rest != 0; rest &= rest - 1)
      pending.Add(x0 + std::countr_zero(rest), y0 + j);
  }
  CastPending(beam, &pending);
  for (int k = 0; k < pending.count; ++k) {
    const size_t pixel = static_cast<size_t>(pending.y[k]) * camera_.width + pending.x[k];
    distance_[pixel] = static_cast<float>(pending.hit[k].distance);
    surface_[pixel] = pending.hit[k].surface;
    tile.slope[pending.y[k] - y0][pending.x[k] - x0] = pending.hit[k].slope;
  }
  ShadeTile(tile);
}

void Renderer::CastPending(const Beam& beam, Pending* pending) const {
  Eigen::Vector3d origins[8], directions[8];
  for (int begin = 0; begin < pending->count; begin += 8) {
    const int count = std::min(8, pending->count - begin);
    for (int k = 0; k < count; ++k) {
      const int y = pending->y[begin + k];
      origins[k] = rows_[y].center;
      directions[k] = Direction(pending->x[begin + k], y);
    }
    scene_->CastEight(origins, directions, count, beam, pending->hit + begin);
  }
}

// Rays through every `step`-th pixel; those of a coarser step are kept.
void Renderer::CastNodes(int x0, int y0, int step, const Beam& beam, const Hit* corners, TileNodes* nodes) const {
  const int count = kTile / step + 1;
  Hit before[kTile / 4 + 1][kTile / 4 + 1];
  const bool finer = nodes->step == 2 * step;
  if (finer) {
    for (int j = 0; j <= kTile / 4; ++j) std::copy(nodes->hit[j], nodes->hit[j] + kTile / 4 + 1, before[j]);
  }
  nodes->step = step;
  Pending pending;
  Hit* asked[kTile * kTile];
  for (int j = 0; j < count; ++j) {
    for (int i = 0; i < count; ++i) {
      Hit& hit = nodes->hit[j][i];
      if (i % (count - 1) == 0 && j % (count - 1) == 0) {
        hit = corners[2 * (i != 0) + (j != 0)];
      } else if (finer && i % 2 == 0 && j % 2 == 0) {
        hit = before[j / 2][i / 2];
      } else {
        asked[pending.count] = &hit;
        pending.Add(x0 + step * i, y0 + step * j);
      }
    }
  }
  CastPending(beam, &pending);
  for (int k = 0; k < pending.count; ++k) *asked[k] = pending.hit[k];
  for (int j = 0; j < count; ++j) {
    const float* stretch = &ray_stretch_[static_cast<size_t>(y0 + step * j) * camera_.width + x0];
    for (int i = 0; i < count; ++i)
      nodes->inverse[j][i] = stretch[step * i] / static_cast<float>(nodes->hit[j][i].distance);
  }
  for (int j = 0; j + 1 < count; ++j) {
    for (int i = 0; i + 1 < count; ++i) {
      // One surface all around, and no jump between the four pixels.
      const int surface = nodes->hit[j][i].surface;
      bool even = surface != Hit::kNothing;
      for (int b = std::max(j - 1, 0); b <= std::min(j + 2, count - 1); ++b) {
        for (int a = std::max(i - 1, 0); a <= std::min(i + 2, count - 1); ++a)
          even &= nodes->hit[b][a].surface == surface;
      }
      const auto& w = nodes->inverse;
      nodes->even[j][i] = even && std::abs(w[j][i] + w[j + 1][i + 1] - w[j][i + 1] - w[j + 1][i]) < 3e-3f * w[j][i];
    }
  }
}

void Renderer::TileNodes::InverseDepths(int row, float* between) const {
  const int shift = step == 4 ? 2 : 1, b = row >> shift;
  const Float8 across =
      step == 4 ? Float8{0, 0.25f, 0.5f, 0.75f, 0, 0.25f, 0.5f, 0.75f} : Float8{0, 0.5f, 0, 0.5f, 0, 0.5f, 0, 0.5f};
  const auto line = [&](const float* w, Float8* at) {
    const Float8 left = shift == 2 ? Float8{w[0], w[0], w[0], w[0], w[1], w[1], w[1], w[1]}
                                   : Float8{w[0], w[0], w[1], w[1], w[2], w[2], w[3], w[3]};
    const Float8 right = shift == 2 ? Float8{w[1], w[1], w[1], w[1], w[2], w[2], w[2], w[2]}
                                    : Float8{w[1], w[1], w[2], w[2], w[3], w[3], w[4], w[4]};
    *at = left + (right - left) * across;
  };
  Float8 above, below;
  line(inverse[b], &above);
  line(inverse[b + 1], &below);
  const Float8 depths = above + (below - above) * (static_cast<float>(row & (step - 1)) / static_cast<float>(step));
  std::memcpy(between, &depths, sizeof depths);
}

bool Renderer::TileNodes::Smooth() const {
  const int count = kTile / step + 1;
  for (int j = 0; j + 1 < count; ++j) {
    for (int i = 0; i + 1 < count; ++i) {
      if (!even[j][i]) return false;
    }
  }
  for (int j = 0; j < count; ++j) {
    for (int i = 0; i + 2 < count; ++i) {
      const float limit = 1.5e-3f * inverse[j][i];
      if (std::abs(inverse[j][i] + inverse[j][i + 2] - 2 * inverse[j][i + 1]) > limit ||
          std::abs(inverse[i][j] + inverse[i + 2][j] - 2 * inverse[i + 1][j]) > limit)
        return false;
    }
  }
  return true;
}

WorldRow Renderer::WorldOf(int y) const {
  const RowPose& row = rows_[y];
  const auto part = [&](int axis) {
    return Color{static_cast<float>(row.rotation(axis, 0)), static_cast<float>(row.rotation(axis, 1)),
                 static_cast<float>(row.rotation(axis, 2)), 0.f};
  };
  return {{static_cast<float>(row.center.x()), static_cast<float>(row.center.y()), static_cast<float>(row.center.z())},
          part(0),
          part(1),
          part(2)};
}

bool Renderer::CanShadeRows(const Eigen::Vector3d& view) const { return view.z() < -0.3 && scene_->foliage > 0; }

GroundLook Renderer::LookOfGround(const Eigen::Vector3d& view, double distance) const {
  const double texels = scene_->ground_texels_per_metre, texel_angle = pixel_angle_ * texels;
  return {scene_->ground.get(),
          scene_->ground->LastWhole(),
          static_cast<float>(texels),
          static_cast<float>(-scene_->grid.x0 * texels - 0.5),
          static_cast<float>(-scene_->grid.y0 * texels - 0.5),
          static_cast<float>(texel_angle),
          scene_->foliage * (1.f / 255),
          scene_->ground_repeat,
          CanopyLevels(static_cast<float>(std::log2(std::max(distance * texel_angle, 1e-3)))),
          scene_->LeavesSeen(view, time_),
          scene_->detail != nullptr ? scene_->Detail(0, 0) : DetailLook()};
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
  const bool common = CanShadeRows(view);
  const GroundLook look = LookOfGround(view, distance_[middle]);
  for (int j = 0; j < kTile; ++j) {
    const int y = tile.y0 + j;
    const size_t row = static_cast<size_t>(y) * camera_.width + tile.x0;
    int ground = 0;
    for (int i = 0; i < kTile; ++i) ground += surface_[row + i] == Hit::kGround;
    if (!common || ground == 0) {
      for (int i = 0; i < kTile; ++i) shade(i, j);
      continue;
    }
    unsigned lanes = 0;
    for (int i = 0; i < kTile; ++i) {
      if (surface_[row + i] == Hit::kGround)
        lanes |= 1u << i;
      else
        shade(i, j);
    }
    RowKernels::Get().shade_ground(look, tile.world[j], tile.slope[j], lanes, PixelsAt(row, kTile, j));
  }
}

}  // namespace mapmend::simulate

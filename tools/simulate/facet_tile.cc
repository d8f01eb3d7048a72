// Tiles of a scene of level ground and convex solids: which solids each may show, its pixels, and its edges.
#include <bit>
#include <cmath>
#include <cstring>

#include "tools/simulate/renderer.h"

namespace mapmend::simulate {

void Renderer::DrawFacets(int tile_row) {
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const int y0 = tile_row * kTile, y_end = std::min(y0 + kTile, camera_.height);
  const FacetRow::Bounds* bounds = tile_bounds_.data() + static_cast<size_t>(tile_row) * tiles;
  FacetRow::Bounds all = bounds[0];
  for (int k = 1; k < tiles; ++k) {
    all = {std::min(all.x0, bounds[k].x0), std::min(all.y0, bounds[k].y0), std::max(all.x1, bounds[k].x1),
           std::max(all.y1, bounds[k].y1)};
  }
  FacetRow& facets = facet_rows_[tile_row];
  const RowPose &first = rows_[y0], &last = rows_[y_end - 1];
  facets.Prepare(*scene_, {Eigen::Quaterniond(first.rotation), first.center},
                 {Eigen::Quaterniond(last.rotation), last.center}, std::max(1, y_end - 1 - y0), all,
                 static_cast<float>(pixel_angle_));
  const RowKernels& kernels = RowKernels::Get();
  std::vector<uint16_t>& list = facet_lists_[tile_row];
  list.clear();
  std::vector<std::pair<uint16_t, float>> seen;  // and how near it may be
  for (int k = 0; k < tiles; ++k) {
    const FacetRow::Bounds& here = bounds[k];
    seen.clear();
    float behind = 0;  // nothing of less inverse depth is seen
    int whole = -1, plane = -1;
    for (size_t s = 0; s < facets.Solids().size(); ++s) {
      const FacetSolid& solid = facets.Solids()[s];
      if (solid.x1 < here.x0 || solid.x0 > here.x1 || solid.y1 < here.y0 || solid.y0 > here.y1) continue;
      const FacetRow::Seen look = facets.See(solid, here);
      if (!look.any || look.high < behind) continue;
      seen.push_back({static_cast<uint16_t>(s), look.high});
      if (look.whole && look.low > behind) behind = look.low, whole = static_cast<int>(s), plane = look.plane;
    }
    const int begin = static_cast<int>(list.size());
    for (const auto& [solid, high] : seen) {
      if (high >= behind) list.push_back(solid);
    }
    const int count = static_cast<int>(list.size()) - begin;
    const bool plain = count == 1 && list[begin] == whole && plane >= 0;
    const int x = k * kTile;
    for (int y = y0; y < y_end; ++y) {
      const size_t i = static_cast<size_t>(y) * width + x;
      const PixelRow pixels = PixelsAt(i, std::min(kTile, width - x), y - y0);
      if (plain)
        kernels.draw_plane(facets, plane, pixels);
      else
        kernels.draw_facets(facets, list.data() + begin, count, pixels);
    }
    const int tile = tile_row * tiles + k;
    tiles_[tile] = {Beam{}, surface_[static_cast<size_t>(y0) * width + x], plain, FindMotion(tile, plain), begin,
                    count};
  }
}

// Where the surface changes, the mean of four rays in place of one. Between plain tiles of one surface it does not.
void Renderer::SmoothFacets(int tile_row, std::vector<Smoothed>* smoothed) const {
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const int y0 = tile_row * kTile, y_end = std::min(y0 + kTile, camera_.height - 1);
  for (int k = 0; k < tiles; ++k) {
    const TileState& tile = tiles_[static_cast<size_t>(tile_row) * tiles + k];
    const int x_end = std::min((k + 1) * kTile, width - 1);
    const int x0 = k * kTile;
    const unsigned inside = (1u << (x_end - x0)) - (x0 == 0 ? 2u : 1u);
    for (int y = std::max(y0, 1); y < y_end; ++y) {
      const bool border = y == y0 || y == y0 + kTile - 1;
      unsigned edges = (Borders(x0, y) | Borders(x0 + 4, y) << 4) & inside;
      if (tile.plain && !border) edges &= 1u | 1u << (kTile - 1);
      for (; edges != 0; edges &= edges - 1)
        SmoothFacetPixel(x0 + std::countr_zero(edges), y, tile_row, tile, smoothed);
    }
  }
}

unsigned Renderer::Borders(int x, int y) const {
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  const auto read = [this](size_t k) {
    Int4 surface;
    std::memcpy(&surface, &surface_[k], sizeof surface);
    return surface;
  };
  const Int4 here = read(i);
  return Lanes((read(i - 1) != here) | (read(i + 1) != here) | (read(i - camera_.width) != here) |
               (read(i + camera_.width) != here));
}

void Renderer::SmoothFacetPixel(int x, int y, int tile_row, const TileState& tile,
                                std::vector<Smoothed>* smoothed) const {
  const int width = camera_.width;
  const size_t i = static_cast<size_t>(y) * width + x;
  const size_t pixels[] = {i, i - 1, i + 1, i - width, i + width};
  const FacetRow& facets = facet_rows_[tile_row];
  const Color a = {-0.375f, 0.125f, 0.375f, -0.125f}, b = {-0.125f, -0.375f, 0.125f, 0.375f};
  const float right_x = plane_x_[i + 1] - plane_x_[i], right_y = plane_y_[i + 1] - plane_y_[i];
  const float down_x = plane_x_[i + width] - plane_x_[i], down_y = plane_y_[i + width] - plane_y_[i];
  const Color ray_x = plane_x_[i] + a * right_x + b * down_x, ray_y = plane_y_[i] + a * right_y + b * down_y;
  Color inverse;
  const auto row = static_cast<float>(y - tile_row * kTile);
  const Int4 planes = facets.Meet(facet_lists_[tile_row].data() + tile.first, tile.count, row, ray_x, ray_y, &inverse);
  Color sum = {};
  for (int k = 0; k < 4; ++k) {
    const int surface = planes[k] < 0 ? Hit::kNothing : facets.Plane(planes[k]).surface;
    // Mostly a neighbour shows the same surface: its colour will do.
    size_t like = i + 1;
    bool found = false;
    for (const size_t pixel : pixels) {
      if (!found && surface_[pixel] == surface) like = pixel, found = true;
    }
    if (found) {
      sum += UnpackLight(light_[like]);
      continue;
    }
    const Eigen::Vector3d ray(ray_x[k], ray_y[k], 1);
    const double stretch = ray.norm();
    const Hit hit{stretch / inverse[k], surface, 0};
    const Color color = scene_->Shade(rows_[y].center, rows_[y].rotation * (ray / stretch), hit, pixel_angle_, time_);
    sum += color * color;
  }
  smoothed->push_back({i, PackLight(SquareRoot(sum * 0.25f))});
}

}  // namespace mapmend::simulate

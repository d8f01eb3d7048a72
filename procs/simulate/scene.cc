#include "procs/simulate/scene.h"

#include <cassert>
#include <limits>

namespace mapmend::simulate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kStep = 1e-7;  // metres: how far past a cell border the next cell is looked up

}  // namespace

double HeightGrid::Height(double x, double y) const {
  const double gx = std::clamp((x - x0) / spacing, 0.0, width - 1.000001);
  const double gy = std::clamp((y - y0) / spacing, 0.0, height - 1.000001);
  const int i = static_cast<int>(gx), j = static_cast<int>(gy);
  const double fx = gx - i, fy = gy - j;
  const double z00 = At(i, j), z10 = At(i + 1, j), z01 = At(i, j + 1), z11 = At(i + 1, j + 1);
  if (fx + fy <= 1) return z00 + (z10 - z00) * fx + (z01 - z00) * fy;
  return z11 + (z01 - z11) * (1 - fx) + (z10 - z11) * (1 - fy);
}

void Scene::Build() {
  assert(levels_.empty() && grid.width > 1 && grid.height > 1);
  Level level{grid.width - 1, grid.height - 1, {}};
  level.max.resize(static_cast<size_t>(level.width) * level.height);
  for (int j = 0; j < level.height; ++j) {
    for (int i = 0; i < level.width; ++i) {
      level.max[static_cast<size_t>(j) * level.width + i] =
          std::max({grid.At(i, j), grid.At(i + 1, j), grid.At(i, j + 1), grid.At(i + 1, j + 1)});
    }
  }
  levels_.push_back(std::move(level));
  const auto halve = [&] {
    const Level& fine = levels_.back();
    Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
    coarse.max.assign(static_cast<size_t>(coarse.width) * coarse.height, -1e9f);
    for (int j = 0; j < fine.height; ++j) {
      for (int i = 0; i < fine.width; ++i) {
        float& max = coarse.max[static_cast<size_t>(j / 2) * coarse.width + i / 2];
        max = std::max(max, fine.max[static_cast<size_t>(j) * fine.width + i]);
      }
    }
    levels_.push_back(std::move(coarse));
  };
  while (static_cast<int>(levels_.size()) <= kLeaf) halve();

  obstacles_ = levels_[1];
  Level& leaf = levels_[kLeaf];
  std::vector<std::vector<int>> lists(leaf.max.size());
  const double block = grid.spacing * (1 << kLeaf);
  for (int s = 0; s < static_cast<int>(solids.size()); ++s) {
    const Solid& solid = solids[s];
    const auto index = [&](double value, double origin, int count) {
      return std::clamp(static_cast<int>(std::floor((value - origin) / block)), 0, count - 1);
    };
    for (int j = index(solid.low.y(), grid.y0, leaf.height); j <= index(solid.high.y(), grid.y0, leaf.height); ++j) {
      for (int i = index(solid.low.x(), grid.x0, leaf.width); i <= index(solid.high.x(), grid.x0, leaf.width); ++i) {
        const size_t cell = static_cast<size_t>(j) * leaf.width + i;
        lists[cell].push_back(s);
        leaf.max[cell] = std::max(leaf.max[cell], static_cast<float>(solid.high.z()) + 1e-3f);
      }
    }
    const double cell = 2 * grid.spacing;
    const auto cell_index = [&](double value, double origin, int count) {
      return std::clamp(static_cast<int>(std::floor((value - origin) / cell)), 0, count - 1);
    };
    for (int j = cell_index(solid.low.y(), grid.y0, obstacles_.height); j <= cell_index(solid.high.y(), grid.y0, obstacles_.height); ++j) {
      for (int i = cell_index(solid.low.x(), grid.x0, obstacles_.width); i <= cell_index(solid.high.x(), grid.x0, obstacles_.width); ++i) {
        float& max = obstacles_.max[static_cast<size_t>(j) * obstacles_.width + i];
        max = std::max(max, static_cast<float>(solid.high.z()) + 1e-3f);
      }
    }
    assert(solid.faces.size() <= 8);
    num_planes_.push_back(static_cast<int>(solid.faces.size()));
    for (int f = 0; f < 8; ++f) {
      const bool used = f < static_cast<int>(solid.faces.size());
      const Face face = used ? solid.faces[f] : Face{};
      planes_.push_back({face.normal.x(), face.normal.y(), face.normal.z(), face.offset});
    }
  }
  list_begin_.push_back(0);
  for (const auto& list : lists) {
    lists_.insert(lists_.end(), list.begin(), list.end());
    list_begin_.push_back(static_cast<uint32_t>(lists_.size()));
  }
  while (levels_.back().width > 1 || levels_.back().height > 1) halve();
}

bool Scene::GroundIsClear(const Eigen::Vector3d* points, const Eigen::Vector3d* directions) const {
  double z = kInfinity;
  for (int k = 0; k < 4; ++k) {
    if (directions[k].z() > -0.35) return false;
    z = std::min(z, points[k].z());
  }
  // Slices of the pyramid, each twice as high as the one below it.
  const double top = levels_.back().max[0], scale = 0.5 / grid.spacing;
  for (double low = 0, high = 1; z + low <= top; low = high, high *= 2) {
    double x0 = kInfinity, x1 = -kInfinity, y0 = kInfinity, y1 = -kInfinity;
    for (int k = 0; k < 4; ++k) {
      for (const double h : {low, high}) {
        const double s = h / directions[k].z();
        const double x = points[k].x() + s * directions[k].x(), y = points[k].y() + s * directions[k].y();
        x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
      }
    }
    const int i0 = std::max(0, static_cast<int>((x0 - grid.x0) * scale)), i1 = std::min(obstacles_.width - 1, static_cast<int>((x1 - grid.x0) * scale));
    const int j0 = std::max(0, static_cast<int>((y0 - grid.y0) * scale)), j1 = std::min(obstacles_.height - 1, static_cast<int>((y1 - grid.y0) * scale));
    if ((i1 - i0 + 1) * (j1 - j0 + 1) > 100) return false;
    const auto limit = static_cast<float>(z + (low == 0 ? 0.4 : low));  // the ground itself may slope a little
    for (int j = j0; j <= j1; ++j) {
      for (int i = i0; i <= i1; ++i) {
        if (obstacles_.max[static_cast<size_t>(j) * obstacles_.width + i] > limit) return false;
      }
    }
  }
  return true;
}

void Scene::CastSolid(int solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit* best) const {
  double enter = 1e-6, leave = best->distance;
  int face = -1;
  const Plane* plane = planes_.data() + 8 * static_cast<size_t>(solid);
  for (int f = 0; f < num_planes_[solid]; ++f, ++plane) {
    const double slope = plane->x * direction.x() + plane->y * direction.y() + plane->z * direction.z();
    const double gap = plane->offset - (plane->x * origin.x() + plane->y * origin.y() + plane->z * origin.z());
    if (slope < 0) {
      if (gap < leave * slope) return;  // enters after it has left
      const double t = gap / slope;
      if (t > enter) enter = t, face = f;
    } else {
      if (gap < enter * slope) return;
      if (slope > 0) leave = std::min(leave, gap / slope);
      else if (gap < 0) return;
    }
    if (enter > leave) return;
  }
  if (face < 0) return;  // the ray starts inside
  best->distance = enter;
  best->surface = 1 + 8 * solid + face;
}

Hit Scene::Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  // In cells of the grid, so that cell borders are integers.
  const double ox = (origin.x() - grid.x0) / grid.spacing, oy = (origin.y() - grid.y0) / grid.spacing;
  const double dx = direction.x() / grid.spacing, dy = direction.y() / grid.spacing;
  const double oz = origin.z(), dz = direction.z();
  const double ix = dx != 0 ? 1 / dx : kInfinity, iy = dy != 0 ? 1 / dy : kInfinity, iz = dz != 0 ? 1 / dz : 0;
  const int cells_x = levels_[0].width, cells_y = levels_[0].height;

  Hit best;
  best.distance = kInfinity;
  double t = 0, t_end = kInfinity;
  if (dx != 0) {
    const double a = -ox * ix, b = (cells_x - ox) * ix;
    t = std::max(t, std::min(a, b));
    t_end = std::min(t_end, std::max(a, b));
  } else if (ox < 0 || ox >= cells_x) {
    return best;
  }
  if (dy != 0) {
    const double a = -oy * iy, b = (cells_y - oy) * iy;
    t = std::max(t, std::min(a, b));
    t_end = std::min(t_end, std::max(a, b));
  } else if (oy < 0 || oy >= cells_y) {
    return best;
  }
  const double top_z = levels_.back().max[0];
  if (dz < 0) t = std::max(t, (top_z - oz) / dz);
  else if (oz > top_z) return best;

  const int top = static_cast<int>(levels_.size()) - 1;
  int level = std::min(top, kLeaf + 2);
  while (t < t_end && t < best.distance) {
    const double probe = t + kStep;
    const int ci = std::clamp(static_cast<int>(ox + probe * dx), 0, cells_x - 1);
    const int cj = std::clamp(static_cast<int>(oy + probe * dy), 0, cells_y - 1);
    const int bi = ci >> level, bj = cj >> level;
    const double edge_x = static_cast<double>((dx > 0 ? bi + 1 : bi) << level);
    const double edge_y = static_cast<double>((dy > 0 ? bj + 1 : bj) << level);
    const double exit_x = dx != 0 ? (edge_x - ox) * ix : kInfinity, exit_y = dy != 0 ? (edge_y - oy) * iy : kInfinity;
    const double t_out = std::min(std::max(std::min(exit_x, exit_y), t + kStep), t_end);
    const double z_low = oz + dz * (dz < 0 ? t_out : t);
    const double max = levels_[level].max[static_cast<size_t>(bj) * levels_[level].width + bi];
    if (z_low <= max) {
      if (level == kLeaf) {
        const size_t block = static_cast<size_t>(bj) * levels_[kLeaf].width + bi;
        for (uint32_t k = list_begin_[block]; k < list_begin_[block + 1]; ++k) {
          CastSolid(lists_[k], origin, direction, &best);
        }
      }
      if (level > 0) {
        if (dz < 0) t = std::max(t, std::min((max - oz) * iz, t_out));
        --level;
        continue;
      }
      const double z00 = grid.At(ci, cj), z10 = grid.At(ci + 1, cj), z01 = grid.At(ci, cj + 1),
                   z11 = grid.At(ci + 1, cj + 1);
      // Height of the ray above a triangle's plane is a + b t; it comes from above: b < 0.
      const auto cross = [&](double z, double slope_x, double slope_y, double corner_x, double corner_y, bool lower) {
        const double a = oz - z - slope_x * (ox - corner_x) - slope_y * (oy - corner_y);
        const double b = dz - slope_x * dx - slope_y * dy;
        if (b >= 0) return;
        const double hit = -a / b;
        if (hit < t - 1e-6 || hit > t_out + 1e-6 || hit >= best.distance || hit <= 0) return;
        const double sum = ox + hit * dx - ci + oy + hit * dy - cj;
        if (lower ? sum > 1 + 1e-9 : sum < 1 - 1e-9) return;
        best.distance = hit;
        best.surface = Hit::kGround;
        best.slope = static_cast<float>(std::sqrt(slope_x * slope_x + slope_y * slope_y) / grid.spacing);
      };
      cross(z00, z10 - z00, z01 - z00, ci, cj, true);
      cross(z11, z11 - z01, z11 - z10, ci + 1, cj + 1, false);
      if (best.surface == Hit::kGround && best.distance <= t_out + 1e-6) break;
    }
    t = t_out;
    // Up a level where the ray leaves the parent block too.
    const double next = t + kStep;
    const int ni = static_cast<int>(ox + next * dx), nj = static_cast<int>(oy + next * dy);
    while (level < top && (ni >> (level + 1) != ci >> (level + 1) || nj >> (level + 1) != cj >> (level + 1))) {
      ++level;
    }
  }
  return best;
}

}  // namespace mapmend::simulate

#include "tools/simulate/scene.h"

#include <bit>
#include <cassert>
#include <limits>

#include "tools/simulate/row_kernels.h"

namespace mapmend::simulate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kStep = 1e-7;  // metres: how far past a cell border the next cell is looked up

// Where along the ray one coordinate lies in 0 to size; false if nowhere.
//   inverse  of the direction
bool ClipToSlab(double origin, double direction, double inverse, int size, double* begin, double* end) {
  if (direction == 0) return origin >= 0 && origin < size;
  const double a = -origin * inverse, b = (size - origin) * inverse;
  *begin = std::max(*begin, std::min(a, b));
  *end = std::min(*end, std::max(a, b));
  return true;
}

}  // namespace

Eigen::Vector3d HeightGrid::Tangent(double x, double y) const {
  const double per_metre = 1 / spacing;
  const double gx = std::clamp((x - x0) * per_metre, 0.0, width - 1.000001);
  const double gy = std::clamp((y - y0) * per_metre, 0.0, height - 1.000001);
  const int i = static_cast<int>(gx), j = static_cast<int>(gy);
  const double fx = gx - i, fy = gy - j;
  const double z00 = At(i, j), z10 = At(i + 1, j), z01 = At(i, j + 1), z11 = At(i + 1, j + 1);
  const bool lower = fx + fy <= 1;
  const double dx = lower ? z10 - z00 : z11 - z01, dy = lower ? z01 - z00 : z11 - z10;
  return {dx * per_metre, dy * per_metre, lower ? z00 + dx * fx + dy * fy : z11 - dx * (1 - fx) - dy * (1 - fy)};
}

Scene::Level Scene::HighestOfCells() const {
  Level level{grid.width - 1, grid.height - 1, {}};
  level.max.resize(static_cast<size_t>(level.width) * level.height);
  for (int j = 0; j < level.height; ++j) {
    for (int i = 0; i < level.width; ++i) {
      level.max[static_cast<size_t>(j) * level.width + i] =
          std::max({grid.At(i, j), grid.At(i + 1, j), grid.At(i, j + 1), grid.At(i + 1, j + 1)});
    }
  }
  return level;
}

Scene::Level Scene::Halved(const Level& fine) {
  Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  coarse.max.assign(static_cast<size_t>(coarse.width) * coarse.height, -1e9f);
  for (int j = 0; j < fine.height; ++j) {
    for (int i = 0; i < fine.width; ++i) {
      float& max = coarse.max[static_cast<size_t>(j / 2) * coarse.width + i / 2];
      max = std::max(max, fine.max[static_cast<size_t>(j) * fine.width + i]);
    }
  }
  return coarse;
}

void Scene::Raise(const Solid& solid, double block, Level* level, const std::function<void(size_t)>& visit) const {
  const auto index = [block](double value, double origin, int count) {
    return std::clamp(static_cast<int>(std::floor((value - origin) / block)), 0, count - 1);
  };
  const int last_i = index(solid.high.x(), grid.x0, level->width),
            last_j = index(solid.high.y(), grid.y0, level->height);
  for (int j = index(solid.low.y(), grid.y0, level->height); j <= last_j; ++j) {
    for (int i = index(solid.low.x(), grid.x0, level->width); i <= last_i; ++i) {
      const size_t at = static_cast<size_t>(j) * level->width + i;
      level->max[at] = std::max(level->max[at], static_cast<float>(solid.high.z()) + 1e-3f);
      if (visit) visit(at);
    }
  }
}

void Scene::AddPlanes(const Solid& solid) {
  assert(solid.faces.size() <= 8);
  num_planes_.push_back(static_cast<int>(solid.faces.size()));
  for (int f = 0; f < 8; ++f) {
    const bool used = f < static_cast<int>(solid.faces.size());
    const Face face = used ? solid.faces[f] : Face{};
    planes_.push_back({face.normal.x(), face.normal.y(), face.normal.z(), face.offset});
  }
}

void Scene::Build() {
  assert(levels_.empty() && grid.width > 1 && grid.height > 1);
  level_ = std::all_of(grid.z.begin(), grid.z.end(), [&](float z) { return z == grid.z[0]; });
  levels_.push_back(HighestOfCells());
  while (static_cast<int>(levels_.size()) <= kLeaf) levels_.push_back(Halved(levels_.back()));

  obstacles_ = levels_[0];
  Level& leaf = levels_[kLeaf];
  std::vector<std::vector<int>> lists(leaf.max.size());
  for (int s = 0; s < static_cast<int>(solids.size()); ++s) {
    Raise(solids[s], grid.spacing * (1 << kLeaf), &leaf, [&](size_t block) { lists[block].push_back(s); });
    Raise(solids[s], grid.spacing, &obstacles_, nullptr);
    AddPlanes(solids[s]);
  }
  list_begin_.push_back(0);
  for (const auto& list : lists) {
    lists_.insert(lists_.end(), list.begin(), list.end());
    list_begin_.push_back(static_cast<uint32_t>(lists_.size()));
  }
  while (levels_.back().width > 1 || levels_.back().height > 1) levels_.push_back(Halved(levels_.back()));
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
      if (slope > 0)
        leave = std::min(leave, gap / slope);
      else if (gap < 0)
        return;
    }
    if (enter > leave) return;
  }
  if (face < 0) return;  // the ray starts inside
  best->distance = enter;
  best->surface = 1 + 8 * solid + face;
}

void Scene::CastCell(int i, int j, const GridRay& ray, double t, double t_out, Hit* best) const {
  const double z00 = grid.At(i, j), z10 = grid.At(i + 1, j), z01 = grid.At(i, j + 1), z11 = grid.At(i + 1, j + 1);
  // Height of the ray above a triangle's plane is a + b t; it comes from above: b < 0.
  const auto cross = [&](double z, double slope_x, double slope_y, double corner_x, double corner_y, bool lower) {
    const double a = ray.oz - z - slope_x * (ray.ox - corner_x) - slope_y * (ray.oy - corner_y);
    const double b = ray.dz - slope_x * ray.dx - slope_y * ray.dy;
    if (b >= 0) return;
    const double hit = -a / b;
    if (hit < t - 1e-6 || hit > t_out + 1e-6 || hit >= best->distance || hit <= 0) return;
    const double sum = ray.ox + hit * ray.dx - i + ray.oy + hit * ray.dy - j;
    if (lower ? sum > 1 + 1e-9 : sum < 1 - 1e-9) return;
    best->distance = hit;
    best->surface = Hit::kGround;
    best->slope = static_cast<float>(std::sqrt(slope_x * slope_x + slope_y * slope_y) / grid.spacing);
  };
  cross(z00, z10 - z00, z01 - z00, i, j, true);
  cross(z11, z11 - z01, z11 - z10, i + 1, j + 1, false);
}

bool Scene::CastDown(const GridRay& ray, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                     const Beam& beam, Hit* best) const {
  const Level& cells = levels_[0];
  double t = std::max(0.0, (beam.height - ray.oz) / ray.dz);
  const double x = ray.ox + t * ray.dx, y = ray.oy + t * ray.dy;
  if (x < 0 || y < 0 || x >= cells.width || y >= cells.height) return false;
  int i = static_cast<int>(x), j = static_cast<int>(y);
  const auto cast_solids = [&] {
    const size_t block = static_cast<size_t>(j >> kLeaf) * levels_[kLeaf].width + (i >> kLeaf);
    for (uint32_t k = list_begin_[block]; k < list_begin_[block + 1]; ++k) {
      CastSolid(lists_[k], origin, direction, best);
    }
  };
  if (beam.solids) cast_solids();
  const int step_i = ray.dx > 0 ? 1 : -1, step_j = ray.dy > 0 ? 1 : -1;
  const double per_x = ray.dx != 0 ? std::abs(1 / ray.dx) : kInfinity,
               per_y = ray.dy != 0 ? std::abs(1 / ray.dy) : kInfinity;
  double next_x = ray.dx != 0 ? t + (ray.dx > 0 ? i + 1 - x : x - i) * per_x : kInfinity;
  double next_y = ray.dy != 0 ? t + (ray.dy > 0 ? j + 1 - y : y - j) * per_y : kInfinity;
  while (true) {
    const double t_out = std::min(next_x, next_y);
    if (ray.oz + ray.dz * std::min(t_out, best->distance) <= cells.max[static_cast<size_t>(j) * cells.width + i])
      CastCell(i, j, ray, t, t_out, best);
    if (best->surface == Hit::kGround || best->distance <= t_out) return true;
    t = t_out;
    if (t == kInfinity) return false;
    const int old_i = i, old_j = j;
    if (next_x < next_y) {
      i += step_i;
      next_x += per_x;
    } else {
      j += step_j;
      next_y += per_y;
    }
    if (i < 0 || j < 0 || i >= cells.width || j >= cells.height) return false;
    if (((old_i ^ i) | (old_j ^ j)) >> kLeaf != 0) cast_solids();
  }
}

bool Scene::SettleOnGround(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Hit* hit) const {
  const double tolerance = 5e-5 * hit->distance;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d point = origin + hit->distance * direction;
    const Eigen::Vector3d tangent = grid.Tangent(point.x(), point.y());
    const double above = point.z() - tangent.z();
    hit->slope = static_cast<float>(std::sqrt(tangent.x() * tangent.x() + tangent.y() * tangent.y()));
    if (std::abs(above) < tolerance) return true;
    const double closing = tangent.x() * direction.x() + tangent.y() * direction.y() - direction.z();
    if (closing < 0.1) return false;
    hit->distance += above / closing;
  }
  return false;
}

Hit Scene::Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, const Beam& beam) const {
  // In cells of the grid, so that cell borders are integers.
  const double per_metre = 1 / grid.spacing;
  const double ox = (origin.x() - grid.x0) * per_metre, oy = (origin.y() - grid.y0) * per_metre;
  const double dx = direction.x() * per_metre, dy = direction.y() * per_metre;
  const double oz = origin.z(), dz = direction.z();
  const GridRay ray{ox, oy, oz, dx, dy, dz};
  Hit nothing, best;
  best.distance = nothing.distance = kInfinity;
  if (beam.height < 1e29) {
    if (CastDown(ray, origin, direction, beam, &best)) return best;
    best = nothing;
  }
  const double ix = dx != 0 ? 1 / dx : kInfinity, iy = dy != 0 ? 1 / dy : kInfinity, iz = dz != 0 ? 1 / dz : 0;
  const int cells_x = levels_[0].width, cells_y = levels_[0].height;
  double t = 0, t_end = kInfinity;
  if (!ClipToSlab(ox, dx, ix, cells_x, &t, &t_end) || !ClipToSlab(oy, dy, iy, cells_y, &t, &t_end)) return best;
  const double top_z = std::min<double>(levels_.back().max[0], beam.height);
  if (dz < 0)
    t = std::max(t, (top_z - oz) * iz);
  else if (oz > top_z)
    return best;
  const int top = static_cast<int>(levels_.size()) - 1;
  int level = std::min(top, beam.solids ? kLeaf + (beam.height < 1e29 ? 0 : 2) : 1);
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
      CastCell(ci, cj, ray, t, t_out, &best);
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

void Scene::CastEight(const Eigen::Vector3d* origins, const Eigen::Vector3d* directions, int count, const Beam& beam,
                      Hit* hits) const {
  unsigned missed = (1u << count) - 1;
  if (count > 2 && !beam.solids && beam.height < 1e29) {
    const double per_metre = 1 / grid.spacing;
    double begin[8] = {}, x[8] = {}, y[8] = {}, least_x = kInfinity, least_y = kInfinity;
    for (int k = 0; k < count; ++k) {
      begin[k] = std::max(0.0, (beam.height - origins[k].z()) / directions[k].z());
      x[k] = (origins[k].x() + begin[k] * directions[k].x() - grid.x0) * per_metre;
      y[k] = (origins[k].y() + begin[k] * directions[k].y() - grid.y0) * per_metre;
      least_x = std::min(least_x, x[k]), least_y = std::min(least_y, y[k]);
    }
    if (std::abs(least_x) > 1e6 || std::abs(least_y) > 1e6) least_x = least_y = 0;
    SteepRays rays{
        static_cast<int>(std::floor(least_x)), static_cast<int>(std::floor(least_y)), {}, {}, {}, {}, {}, {}};
    for (int k = 0; k < count; ++k) {
      rays.x[k] = static_cast<float>(x[k] - rays.i), rays.y[k] = static_cast<float>(y[k] - rays.j);
      rays.z[k] = static_cast<float>(origins[k].z() + begin[k] * directions[k].z());
      rays.dx[k] = static_cast<float>(directions[k].x() * per_metre);
      rays.dy[k] = static_cast<float>(directions[k].y() * per_metre);
      rays.dz[k] = static_cast<float>(directions[k].z());
    }
    const HeightCells cells{&grid, levels_[0].max.data(), list_begin_.data(), levels_[0].width, levels_[0].height,
                            kLeaf, levels_[kLeaf].width};
    float along[8], slope[8];
    const unsigned found = RowKernels::Get().cast_down(cells, rays, missed, along, slope);
    for (unsigned rest = found; rest != 0; rest &= rest - 1) {
      const int k = std::countr_zero(rest);
      hits[k] = {begin[k] + along[k], Hit::kGround, slope[k]};
    }
    missed &= ~found;
  }
  for (; missed != 0; missed &= missed - 1) {
    const int k = std::countr_zero(missed);
    hits[k] = Cast(origins[k], directions[k], beam);
  }
}

}  // namespace mapmend::simulate

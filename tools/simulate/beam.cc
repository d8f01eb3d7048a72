// What is empty between the rays of a small piece of the image, found without casting rays.
#include <cmath>
#include <cstring>

#include "tools/simulate/scene.h"

namespace mapmend::simulate {

Scene::Fan::Fan(const Eigen::Vector3d* points, const Eigen::Vector3d* directions) {
  for (int k = 0; k < 4; ++k) {
    x[k] = points[k].x(), y[k] = points[k].y(), z[k] = points[k].z();
    slope_x[k] = directions[k].x() / directions[k].z();
    slope_y[k] = directions[k].y() / directions[k].z();
  }
}

Scene::Cells Scene::CellsBetween(double low, double high, const Fan& fan, int level) const {
  using Double4 = double __attribute__((vector_size(32)));
  const auto read = [](const double* from, Double4* to) { std::memcpy(to, from, sizeof *to); };
  Double4 x, y, z, slope_x, slope_y;
  read(fan.x, &x), read(fan.y, &y), read(fan.z, &z), read(fan.slope_x, &slope_x), read(fan.slope_y, &slope_y);
  const Double4 to_low = low - z, to_high = high - z;
  const auto bounds = [&](const Double4& at, const Double4& slope, double* least, double* greatest) {
    const Double4 a = at + to_low * slope, b = at + to_high * slope;
    const Double4 less = a < b ? a : b, more = a < b ? b : a;
    *least = std::min(std::min(less[0], less[1]), std::min(less[2], less[3]));
    *greatest = std::max(std::max(more[0], more[1]), std::max(more[2], more[3]));
  };
  double x0, x1, y0, y1;
  bounds(x, slope_x, &x0, &x1);
  bounds(y, slope_y, &y0, &y1);
  // Rays between the four may bulge a little, by lens distortion; those that smooth an edge start half a pixel outside.
  const double margin = 0.02 + (x1 - x0 + y1 - y0) / 12, scale = 1 / (grid.spacing * (1 << level));
  const auto cell = [](double v, int count) { return static_cast<int>(std::clamp(v, 0.0, count - 1.0)); };
  const int width = levels_[level].width, height = levels_[level].height;
  return {cell((x0 - margin - grid.x0) * scale, width), cell((x1 + margin - grid.x0) * scale, width),
          cell((y0 - margin - grid.y0) * scale, height), cell((y1 + margin - grid.y0) * scale, height)};
}

float Scene::Greatest(const Level& level, const Cells& cells) {
  float max = -1e9f;
  for (int y = cells.y0; y <= cells.y1; ++y) {
    for (int x = cells.x0; x <= cells.x1; ++x) max = std::max(max, level.max[static_cast<size_t>(y) * level.width + x]);
  }
  return max;
}

Beam Scene::ClearBeam(const Eigen::Vector3d* origins, const Eigen::Vector3d* directions, const Beam& within) const {
  Beam beam;
  double height = std::min<double>(levels_.back().max[0], within.height);
  for (int k = 0; k < 4; ++k) {
    if (directions[k].z() > -0.35) return beam;
    height = std::min(height, origins[k].z());
  }
  const Fan fan(origins, directions);
  double step = within.height < 1e29 ? 1 : 4;
  for (int i = 0; i < 40; ++i) {
    const Cells cells = CellsBetween(height - step, height, fan, 0);
    if ((cells.x1 - cells.x0 + 1) * (cells.y1 - cells.y0 + 1) > 300) {
      if (step > 1) {
        step /= 2;
        continue;
      }
      return beam;
    }
    const double max = Greatest(obstacles_, cells);
    if (max <= height - step) {
      height -= step;
      step *= 2;
    } else if (max < height - 0.3) {
      height = max;
      step = std::max(step / 2, 1.0);
    } else if (step > 1) {
      step /= 2;
    } else {
      break;
    }
  }
  beam.height = height + 1e-3;
  const Cells blocks = CellsBetween(beam.height, beam.height, fan, kLeaf);
  beam.solids = false;
  for (int y = blocks.y0; y <= blocks.y1; ++y) {
    const size_t row = static_cast<size_t>(y) * levels_[kLeaf].width;
    beam.solids |= list_begin_[row + blocks.x0] != list_begin_[row + blocks.x1 + 1];
  }
  return beam;
}

bool Scene::IsFlat(const Eigen::Vector3d* points, double tolerance) const {
  const Eigen::Vector3d middle = 0.25 * (points[0] + points[1] + points[2] + points[3]);
  const Eigen::Vector3d a = points[3] - points[0], b = points[2] - points[1];
  const double nx = a.y() * b.z() - a.z() * b.y(), ny = a.z() * b.x() - a.x() * b.z(),
               nz = a.x() * b.y() - a.y() * b.x();
  if (std::abs(nz) < 1e-9) return false;
  const double slope_x = -nx / nz, slope_y = -ny / nz;
  double x0 = middle.x(), x1 = x0, y0 = middle.y(), y1 = y0;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d& p = points[k];
    if (std::abs(p.z() - middle.z() - slope_x * (p.x() - middle.x()) - slope_y * (p.y() - middle.y())) > tolerance)
      return false;
    x0 = std::min(x0, p.x()), x1 = std::max(x1, p.x()), y0 = std::min(y0, p.y()), y1 = std::max(y1, p.y());
  }
  // Between vertices on the plane there is nothing but the plane.
  const int i0 = static_cast<int>(std::floor((x0 - grid.x0) / grid.spacing)),
            i1 = static_cast<int>(std::ceil((x1 - grid.x0) / grid.spacing));
  const int j0 = static_cast<int>(std::floor((y0 - grid.y0) / grid.spacing)),
            j1 = static_cast<int>(std::ceil((y1 - grid.y0) / grid.spacing));
  if (i0 < 0 || j0 < 0 || i1 >= grid.width || j1 >= grid.height || (i1 - i0) * (j1 - j0) > 200) return false;
  for (int j = j0; j <= j1; ++j) {
    double z = middle.z() + slope_x * (grid.x0 + i0 * grid.spacing - middle.x()) +
               slope_y * (grid.y0 + j * grid.spacing - middle.y());
    for (int i = i0; i <= i1; ++i, z += slope_x * grid.spacing) {
      if (std::abs(grid.At(i, j) - z) > tolerance) return false;
    }
  }
  return true;
}

bool Scene::IsClear(const Beam& beam, const Eigen::Vector3d* points, const Eigen::Vector3d* directions,
                    int surface) const {
  double low = std::min(std::min(points[0].z(), points[1].z()), std::min(points[2].z(), points[3].z()));
  if (surface == Hit::kGround) return beam.height < low + 0.4;
  if (beam.height > 1e29 || !beam.solids) return false;
  const Cells cells = CellsBetween(low, beam.height, Fan(points, directions), 0);
  if ((cells.x1 - cells.x0 + 1) * (cells.y1 - cells.y0 + 1) > 300 || Greatest(levels_[0], cells) > low) return false;
  // Other solids near: their bounding boxes must be outside.
  const double x0 = grid.x0 + cells.x0 * grid.spacing, x1 = grid.x0 + (cells.x1 + 1) * grid.spacing;
  const double y0 = grid.y0 + cells.y0 * grid.spacing, y1 = grid.y0 + (cells.y1 + 1) * grid.spacing;
  const int own = (surface - 1) / 8;
  for (int y = cells.y0 >> kLeaf; y <= cells.y1 >> kLeaf; ++y) {
    for (int x = cells.x0 >> kLeaf; x <= cells.x1 >> kLeaf; ++x) {
      const size_t block = static_cast<size_t>(y) * levels_[kLeaf].width + x;
      for (uint32_t k = list_begin_[block]; k < list_begin_[block + 1]; ++k) {
        const Solid& other = solids[lists_[k]];
        if (lists_[k] != own && other.high.z() > low && other.low.x() < x1 && other.high.x() > x0 &&
            other.low.y() < y1 && other.high.y() > y0) {
          return false;
        }
      }
    }
  }
  return true;
}

}  // namespace mapmend::simulate

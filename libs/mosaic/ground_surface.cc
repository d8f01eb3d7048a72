#include "libs/mosaic/ground_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Heights of cells, some of them unknown, and how sure each is.
struct CellGrid {
  int columns = 0, rows = 0;
  std::vector<double> heights, weights;

  size_t Index(int column, int row) const {
    return static_cast<size_t>(row) * static_cast<size_t>(columns) + static_cast<size_t>(column);
  }
};

// A cell's height is the median of its points; many points make it surer.
CellGrid MedianHeights(const std::vector<Eigen::Vector3d>& points, const GroundBounds& bounds, double cell, int columns,
                       int rows) {
  std::vector<std::vector<double>> of_cell(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  CellGrid grid{columns, rows, {}, {}};
  for (const Eigen::Vector3d& p : points) {
    const int column = static_cast<int>(std::floor((p.x() - bounds.low.x()) / cell));
    const int row = static_cast<int>(std::floor((p.y() - bounds.low.y()) / cell));
    if (column < 0 || row < 0 || column >= columns || row >= rows) continue;
    of_cell[grid.Index(column, row)].push_back(p.z());
  }
  constexpr double kEnoughPoints = 8;
  for (std::vector<double>& heights : of_cell) {
    grid.weights.push_back(std::min(1.0, static_cast<double>(heights.size()) / kEnoughPoints));
    grid.heights.push_back(heights.empty() ? kUnknown : Median(std::move(heights)));
  }
  return grid;
}

// Cells that stand out from the known ones around them become unknown: by more than those differ among themselves, and
// by more than cells do in general.
void LeaveOutliersOut(double max_mads, CellGrid* grid) {
  constexpr int kReach = 3;
  std::vector<double> differences(grid->heights.size(), 0), spreads(grid->heights.size(), 0), known;
  for (int row = 0; row < grid->rows; ++row) {
    for (int column = 0; column < grid->columns; ++column) {
      const size_t here = grid->Index(column, row);
      if (std::isnan(grid->heights[here])) continue;
      std::vector<double> around;
      for (int r = std::max(0, row - kReach); r <= std::min(grid->rows - 1, row + kReach); ++r) {
        for (int c = std::max(0, column - kReach); c <= std::min(grid->columns - 1, column + kReach); ++c) {
          const double height = grid->heights[grid->Index(c, r)];
          if (!std::isnan(height)) around.push_back(height);
        }
      }
      const double median = Median(around);
      for (double& height : around) height = std::abs(height - median);
      spreads[here] = Median(std::move(around));
      differences[here] = std::abs(grid->heights[here] - median);
      known.push_back(differences[here]);
    }
  }
  const double usual = std::max(Median(std::move(known)), 1e-12);
  for (size_t i = 0; i < differences.size(); ++i) {
    if (differences[i] <= max_mads * std::max(usual, spreads[i])) continue;
    grid->heights[i] = kUnknown;
    grid->weights[i] = 0;
  }
}

// Half as many cells each way, each the weighted mean of four.
CellGrid Halve(const CellGrid& fine) {
  CellGrid coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}, {}};
  for (int row = 0; row < coarse.rows; ++row) {
    for (int column = 0; column < coarse.columns; ++column) {
      double sum = 0, weight = 0;
      for (int r = 2 * row; r < std::min(fine.rows, 2 * row + 2); ++r) {
        for (int c = 2 * column; c < std::min(fine.columns, 2 * column + 2); ++c) {
          const size_t i = fine.Index(c, r);
          if (std::isnan(fine.heights[i])) continue;
          sum += fine.weights[i] * fine.heights[i];
          weight += fine.weights[i];
        }
      }
      coarse.heights.push_back(weight > 0 ? sum / weight : kUnknown);
      coarse.weights.push_back(std::min(1.0, weight));
    }
  }
  return coarse;
}

// Gauss-Seidel on the membrane, from a first guess.
std::vector<double> Relax(const CellGrid& grid, double smoothness, int sweeps, std::vector<double> heights) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        const size_t here = grid.Index(column, row);
        const bool is_known = !std::isnan(grid.heights[here]);
        double sum = is_known ? grid.weights[here] * grid.heights[here] : 0, weight = is_known ? grid.weights[here] : 0;
        const auto add = [&](int c, int r) {
          if (c < 0 || r < 0 || c >= grid.columns || r >= grid.rows) return;
          sum += smoothness * heights[grid.Index(c, r)];
          weight += smoothness;
        };
        add(column - 1, row), add(column + 1, row), add(column, row - 1), add(column, row + 1);
        if (weight > 0) heights[here] = sum / weight;
      }
    }
  }
  return heights;
}

// From coarse to fine: what lies far from any point gets its height at the level where it is near one.
std::vector<double> Membrane(const CellGrid& grid, double smoothness) {
  constexpr int kSweeps = 30;
  std::vector<double> guess(grid.heights.size(), 0);
  if (grid.columns > 1 || grid.rows > 1) {
    const CellGrid coarse = Halve(grid);
    const std::vector<double> below = Membrane(coarse, smoothness);
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column)
        guess[grid.Index(column, row)] = below[coarse.Index(column / 2, row / 2)];
    }
  }
  return Relax(grid, smoothness, kSweeps, std::move(guess));
}

}  // namespace

GroundSurface::GroundSurface(const std::vector<Eigen::Vector3d>& points, const GroundBounds& bounds,
                             const GroundSurfaceOptions& options)
    : GroundSurface(0) {
  const auto inside = [&](const Eigen::Vector3d& p) {
    return (p.head<2>().array() >= bounds.low.array()).all() && (p.head<2>().array() < bounds.high.array()).all();
  };
  const auto num_inside = std::count_if(points.begin(), points.end(), inside);
  if (bounds.IsEmpty() || num_inside == 0) return;
  bounds_ = bounds;
  const Eigen::Vector2d size = bounds.Size();
  cell_ = std::max(std::sqrt(size.x() * size.y() * options.points_per_cell / static_cast<double>(num_inside)),
                   size.maxCoeff() / options.max_cells);
  columns_ = std::max(1, static_cast<int>(std::ceil(size.x() / cell_)));
  rows_ = std::max(1, static_cast<int>(std::ceil(size.y() / cell_)));
  CellGrid grid = MedianHeights(points, bounds, cell_, columns_, rows_);
  LeaveOutliersOut(options.outlier_mads, &grid);
  heights_ = Membrane(grid, options.smoothness);
  std::vector<double> residuals;
  for (const Eigen::Vector3d& p : points) {
    if (inside(p)) residuals.push_back(std::abs(p.z() - Height(p.x(), p.y())));
  }
  median_residual_ = Median(std::move(residuals));
}

double GroundSurface::Height(double x, double y) const {
  const double u = std::clamp((x - bounds_.low.x()) / cell_ - 0.5, 0.0, columns_ - 1.0);
  const double v = std::clamp((y - bounds_.low.y()) / cell_ - 0.5, 0.0, rows_ - 1.0);
  const int column = std::min(static_cast<int>(u), std::max(0, columns_ - 2));
  const int row = std::min(static_cast<int>(v), std::max(0, rows_ - 2));
  const int next_column = std::min(column + 1, columns_ - 1), next_row = std::min(row + 1, rows_ - 1);
  const double fu = u - column, fv = v - row;
  const auto at = [&](int c, int r) {
    return heights_[static_cast<size_t>(r) * static_cast<size_t>(columns_) + static_cast<size_t>(c)];
  };
  return (1 - fv) * ((1 - fu) * at(column, row) + fu * at(next_column, row)) +
         fv * ((1 - fu) * at(column, next_row) + fu * at(next_column, next_row));
}

}  // namespace mapmend

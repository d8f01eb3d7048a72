#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libs/base/range.h"

namespace mapmend {

// A rectangle of the ground, in a frame whose z points up.
struct GroundBounds {
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();

  Eigen::Vector2d Size() const { return high - low; }
  bool IsEmpty() const { return !(high.x() > low.x()) || !(high.y() > low.y()); }
};

struct GroundSurfaceOptions {
  double points_per_cell = 6;  // of the map points inside the bounds, on average
  int max_cells = 400;         // along the longer side
  double smoothness = 0.5;     // weight of a step between neighbouring cells, of that of a cell's own height
  double outlier_mads = 4;     // a cell so far from its neighbours (median absolute deviations) is left out

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("points_per_cell", points_per_cell, Range(0.1, 1e6), "points");
    v("max_cells", max_cells, Range(4, 10000), "cells");
    v("smoothness", smoothness, Range(1e-6, 1e6));
    v("outlier_mads", outlier_mads, MoreThan(0), "median absolute deviations");
  }
};

// The ground as heights over a plane grid, from the points of a map: a cell's height is the median of its points; cells
// that stand out from their neighbours (wrong points) are left out, and a membrane (minimal squared steps between
// neighbours) fills what no point tells and evens out the noise.
class GroundSurface {
 public:
  // A horizontal plane.
  explicit GroundSurface(double height = 0) : heights_(1, height) {}
  // points: z up. Outside the bounds the surface goes on horizontally from its border. Without a point it is the plane
  // z = 0.
  GroundSurface(const std::vector<Eigen::Vector3d>& points, const GroundBounds& bounds,
                const GroundSurfaceOptions& options);

  // Bilinear between the centres of cells.
  double Height(double x, double y) const;
  // Median absolute distance of the points from the surface, vertical.
  double MedianResidual() const { return median_residual_; }

 private:
  GroundBounds bounds_;
  double cell_ = 1;
  int columns_ = 1, rows_ = 1;
  std::vector<double> heights_;  // row by row from low y
  double median_residual_ = 0;
};

}  // namespace mapmend

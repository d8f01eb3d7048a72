#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "libs/optim/bundle_adjustment.h"

// Bundle adjustment by a part of the points: a few hundred per image determine its pose as well as thousands do, the
// others follow.
namespace mapmend {

// Observations of the problem by their points: those of point i are observations[first[i]] to [first[i + 1]], by index.
struct ObservationsByPoint {
  explicit ObservationsByPoint(const BundleProblem& problem);
  std::span<const int> Of(size_t point) const {
    return {indices.data() + first[point], indices.data() + first[point + 1]};
  }

  std::vector<int> first, indices;
};

// Marks with 1 the points that should determine the poses: those with most observations first (ties: the lower index),
// until in each image of a free pose every cell that has any holds its share of per_pose.
std::vector<uint8_t> ChooseBundlePoints(const BundleProblem& problem, const ObservationsByPoint& by_point,
                                        int per_pose);

// Moves a point to where the poses see it (robust, Gauss-Newton with decrease checked); leaves it where it is if no
// step helps. rotations: of the poses. observations: indices of the point's.
void RefineBundlePoint(const BundleProblem& problem, const std::vector<Eigen::Matrix3d>& rotations,
                       std::span<const int> observations, double huber, Eigen::Vector3d* point);

}  // namespace mapmend

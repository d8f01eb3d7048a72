#include "libs/optim/bundle_adjustment.h"

#include <limits>

#include "libs/optim/bundle_adjuster.h"

namespace mapmend {

BundleSummary AdjustBundle(const BundleOptions& options, BundleProblem* problem) {
  return BundleAdjuster().Adjust(options, problem);
}

double ReprojectionChi2(const Pinhole& camera, const Rigid3& cam_from_world, const Eigen::Vector3d& point,
                        const Eigen::Vector2d& pixel, double sigma) {
  const Eigen::Vector3d x = cam_from_world * point;
  if (!(x.z() > 1e-6)) return std::numeric_limits<double>::infinity();
  return (camera.Project(x) - pixel).squaredNorm() / (sigma * sigma);
}

}  // namespace mapmend

#pragma once

#include <memory>
#include <vector>

#include "libs/optim/bundle_adjustment.h"

namespace mapmend {

struct PositionPrior;

// Bundle adjustment of one window after the other. Gives what AdjustBundle gives, to the bit, and is faster: blocks of
// parameters, cost functions and the order of elimination stay from one call to the next. The ceres::Problem does not:
// docs/frontend_benchmarks.md says why.
class BundleAdjuster {
 public:
  BundleAdjuster();
  ~BundleAdjuster();
  BundleAdjuster(BundleAdjuster&&) noexcept;
  BundleAdjuster& operator=(BundleAdjuster&&) noexcept;

  // positions: of poses that observe something; null: none.
  BundleSummary Adjust(const BundleOptions& options, BundleProblem* problem,
                       const std::vector<PositionPrior>* positions = nullptr);

 private:
  struct Kept;
  class Window;
  std::unique_ptr<Kept> kept_;
};

}  // namespace mapmend

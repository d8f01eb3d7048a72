#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/chi_square.h"
#include "libs/geometry/sim3_correspondence.h"

namespace mapmend {

// A map point of submap a believed to be the same as one of submap b. a_in_b.point is a's point and a_in_b.pixel the
// feature of b that observes b's point; b_in_a the other way round.
struct PointMatch {
  CrossObservation a_in_b;
  CrossObservation b_in_a;
};

struct Sim3RansacOptions {
  uint64_t seed = 1;
  int max_iterations = 400;
  double confidence = 0.999;  // stop once a better model has been missed with less than 1 - confidence
  double max_squared_error = kChiSquare2Dof99;  // both ways, in sigma^2
  double max_scale = 8;                         // of b_from_a, and its inverse; beyond it ORB cannot have matched
  int min_inliers = 4;

  // Not visited: seed: that of the flight.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 1e6));
    v("confidence", confidence, Between(0, 1));
    v("max_squared_error", max_squared_error, MoreThan(0), "sigma^2");
    v("max_scale", max_scale, AtLeast(1));
    v("min_inliers", min_inliers, Range(3, 100000));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

struct Sim3RansacResult {
  bool success = false;
  Similarity3 b_from_a;
  std::vector<char> is_inlier;  // per match
  int num_inliers = 0;
  int num_iterations = 0;
};

// Sim(3) between two submaps from point matches with outliers: minimal samples of three (closed form, Horn), a match is
// an inlier if it reprojects well in both images; each new best model is fitted again to its inliers. Same input and
// seed, same result, on every machine with IEEE arithmetic.
Sim3RansacResult EstimateSim3(const std::vector<PointMatch>& matches, const Sim3RansacOptions& options);

}  // namespace mapmend

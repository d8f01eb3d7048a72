#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "libs/geometry/similarity3.h"

namespace mapmend {

// Similarity b_from_a that best maps points a[i] onto b[i], in closed form: rotation of least squares (S. Umeyama, PAMI
// 1991, eq. 40), and the symmetric scale sqrt(var(b) / var(a)) of B. Horn (JOSA A 1987, eq. 4), which does not favour
// the side with less noise, so that HornAlignment(a, b) is the inverse of HornAlignment(b, a). Needs three or more
// pairs; nullopt if they are (nearly) collinear or coincide, since then the rotation is not determined.
// With weights, one per pair, squared errors count by them.
std::optional<Similarity3> HornAlignment(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b,
                                         const std::vector<double>& weights = {});

// The same for reconstructed points, of which a few lie anywhere and far ones are uncertain in proportion to their
// distance: errors are measured relative to the distance from the middle of the points, and weighed down where they
// are larger than most (iterated least squares with a Cauchy weight; scale by the median). Up to a third of the pairs
// may be wrong by any amount. nullopt as above, and if more than half of the points of either side coincide.
std::optional<Similarity3> RobustAlignment(const std::vector<Eigen::Vector3d>& a,
                                           const std::vector<Eigen::Vector3d>& b);

}  // namespace mapmend

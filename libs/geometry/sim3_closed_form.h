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
std::optional<Similarity3> HornAlignment(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b);

}  // namespace mapmend

#pragma once

#include <Eigen/Core>

namespace mapmend {

// Of the rotation about w by |w| radians: d exp(w + e) = exp(LeftJacobian(w) e) exp(w); also the mean of exp(s w) over
// s from 0 to 1.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& w);

}  // namespace mapmend

#pragma once

#include <vector>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/optim/pose_optimization.h"

namespace mapmend {

// How well the observations, taken for right, fix the position of the camera: its standard deviation in the worst
// direction, as a share of the median depth of the points. From the Hessian of the reprojection errors at the pose;
// infinite if it is singular. A tenth of the observations is left out, one after the other that with the most
// influence: if a few near points alone hold a pose that the others leave open, it is only as right as those few. What
// lies within an eightieth of the image width counts as one observation: it is one corner at several octaves, off by
// one error.
double RelativePositionSigma(const Pinhole& camera, const Rigid3& cam_from_world,
                             const std::vector<PoseObservation>& observations);

}  // namespace mapmend

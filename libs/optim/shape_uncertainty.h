#pragma once

#include "libs/optim/bundle_adjustment.h"

namespace mapmend {

// How well the observations, taken for right, fix the shape of the path of the cameras: the standard deviation of their
// centres, seen from the first one with its orientation, as a share of the path's own extent. Both as root mean squares
// over the other cameras; the scale, which nothing fixes, is left out. Points may move along: it is what is left after
// a bundle adjustment, from the Hessian of the reprojection errors with the points eliminated. One unit of it is one
// pixel of noise (at octave 0). What lies within an eightieth of the image width counts as one observation, as in
// RelativePositionSigma. The first pose is the one that is held; whether poses are marked as fixed does not matter.
// Infinite if the problem is singular: fewer than two poses, no motion between them, too few points.
//   max_chi2  observations with a larger squared error, in sigma, say nothing
double RelativeShapeSigma(const BundleProblem& problem, double max_chi2);

}  // namespace mapmend

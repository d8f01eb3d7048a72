#pragma once

#include <Eigen/Core>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "libs/geometry/rigid3.h"

// Bundle adjustment: poses and points that minimise sum rho(|project(cam_from_world * point) - pixel|^2 / sigma^2).
// Ceres, Levenberg-Marquardt with a Schur complement, analytic Jacobians, one thread (so the result is
// bit-reproducible).
namespace mapmend {

struct BundlePose {
  Rigid3 cam_from_world;
  bool fixed = false;
  int camera = 0;  // index into BundleProblem::cameras
};

struct BundleObservation {
  int pose = -1;
  int point = -1;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma = 1.0;  // pixels
};

struct BundleProblem {
  std::vector<Pinhole> cameras;
  std::vector<BundlePose> poses;        // at least one fixed, or the gauge is left to the damping; scale needs two
  std::vector<Eigen::Vector3d> points;  // world frame
  std::vector<BundleObservation> observations;

  // Readout times of rolling shutters (rolling_shutter.h), unknowns too; empty: all pixels are as they are.
  std::vector<double> readouts;                     // seconds
  std::vector<int> readout_of_camera;               // index into readouts per camera
  std::vector<Eigen::Vector2f> shutter_correction;  // per observation, pixels per second of readout time
};

struct BundleOptions {
  int max_iterations = 10;
  double huber = kChi2Dof95;  // in units of sigma
  double function_tolerance = 1e-5;
  int points_per_pose =
      0;  // 0: all. Else poses follow from about so many points each, and the other points from the poses
  double initial_trust_radius = 1e4;  // of Levenberg-Marquardt: larger, and the first steps are those of Gauss-Newton
  double readout_sigma = 0.03;        // seconds; readout times are drawn to zero by so much
  double max_seconds = 0;             // 0: no bound. A bound makes the result depend on the machine: live use only.

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 10000));
    v("huber", huber, MoreThan(0), "sigma");
    v("function_tolerance", function_tolerance, AtLeast(0));
    v("points_per_pose", points_per_pose, Range(0, 1e6), "points; 0: all");
    v("initial_trust_radius", initial_trust_radius, MoreThan(0));
    v("readout_sigma", readout_sigma, MoreThan(0), "s");
    v("max_seconds", max_seconds, AtLeast(0), "s; 0: no bound");
  }
};

struct BundleSummary {
  bool success = false;
  int iterations = 0;
  double initial_cost = 0, final_cost = 0;  // robust costs
};

// Improves problem in place. On failure (no usable observation, solver breakdown) the problem is unchanged.
BundleSummary AdjustBundle(const BundleOptions& options, BundleProblem* problem);

// Squared error over sigma^2 of one observation; infinity behind the camera.
double ReprojectionChi2(const Pinhole& camera, const Rigid3& cam_from_world, const Eigen::Vector3d& point,
                        const Eigen::Vector2d& pixel, double sigma);

}  // namespace mapmend

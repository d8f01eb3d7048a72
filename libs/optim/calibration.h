#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/chi_square.h"
#include "libs/geometry/rigid3.h"

// Calibration of a camera by the map that it has made: bundle adjustment of poses, points and the camera.
namespace mapmend {

struct CalibrationObservation {
  int pose = -1, point = -1;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // as in the image, distorted
  double sigma = 1;                                 // pixels
};

struct CalibrationProblem {
  Camera camera;              // the first guess, pinhole model
  std::vector<Rigid3> poses;  // cam_from_world
  std::vector<Eigen::Vector3d> points;
  std::vector<CalibrationObservation> observations;
};

struct CalibrationOptions {
  int max_iterations = 60;
  double huber = kChi2Dof95;               // sigma
  double outlier_chi2 = kChiSquare2Dof99;  // sigma^2; observations beyond it are left out the second time
  double max_focal_sigma = 0.02;           // relative; if it is known worse, the camera cannot be told from the motion
  double profile_step = 0.03;              // relative change of the focal length that must make the errors grow
  double max_change = 0.35;                // relative, of the focal length; beyond it nothing is believed

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 10000));
    v("huber", huber, MoreThan(0), "sigma");
    v("outlier_chi2", outlier_chi2, MoreThan(0), "sigma^2");
    v("max_focal_sigma", max_focal_sigma, MoreThan(0), "of the focal length");
    v("profile_step", profile_step, Range(0.001, 0.2), "of the focal length");
    v("max_change", max_change, Range(0.01, 0.9), "of the focal length");
  }
};

struct Calibration {
  bool success = false;
  std::string reason;  // if not: one sentence
  Camera camera;
  // Standard deviations: of fx in pixels, of k1 k2 p1 p2. From the residuals' own size; what all images have in common
  // (a rolling shutter, a lens that the model does not fit) is not in them.
  double sigma_focal = 0;
  std::array<double, 4> sigma_distortion = {};
  double rms_before = 0,
         rms_after = 0;  // of the inliers' reprojections, pixels; before: the best map with the first guess
  int num_observations = 0, num_points = 0;
};

// Two standard deviations of the focal length are worked out, and the larger one counts: from the normal equations at
// the solution, and from how much worse everything fits with a focal length that is fixed a little off. The first is
// too small where noise looks like relief (flat ground seen from straight above), the second is not.
Calibration CalibrateByMap(const CalibrationOptions& options, const CalibrationProblem& problem);

// The robust cost that is left when the focal length and the distortion are free too, whatever they become. Nothing if
// the adjustment fails.
std::optional<double> CostWithFreeLens(const CalibrationOptions& options, const CalibrationProblem& problem);

}  // namespace mapmend

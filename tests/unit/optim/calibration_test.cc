#include "libs/optim/calibration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libs/base/random.h"
#include "libs/optim/calibration_cost.h"

namespace mapmend {
namespace calibration_test {

Camera TrueCamera() {
  Camera camera;
  camera.width = 800;
  camera.height = 600;
  camera.fx = camera.fy = 480;
  camera.cx = 399.5;
  camera.cy = 299.5;
  camera.distortion = {-0.05, 0.02, 0.001, -0.0005, 0};
  return camera;
}

double Gauss(Random* random) {
  return std::sqrt(-2 * std::log(1 - random->Uniform())) * std::cos(2 * M_PI * random->Uniform());
}

// What a flight looks like.
struct Flight {
  double relief = 8;        // metres, of the ground 50 m below
  double tilt_deg = 25;     // forwards and backwards, every other image
  bool is_forward = false;  // along the view, through a tunnel of points, without turning
};

// Right up to the noise of half a pixel, but for the camera, whose focal length is wrong by 5 % and which has no
// distortion.
CalibrationProblem MakeProblem(const Flight& flight) {
  Random random(7);
  const Camera camera = TrueCamera();
  CalibrationProblem problem;
  problem.camera = camera;
  problem.camera.fx = problem.camera.fy = 1.05 * camera.fx;
  problem.camera.distortion = {};
  for (int i = 0; i < 24; ++i) {
    Eigen::Vector3d center(12.0 * (i % 8), 15.0 * (i / 8), 50);
    const double yaw = i / 8 % 2 == 0 ? 0 : M_PI, tilt = flight.tilt_deg * M_PI / 180 * (i % 2 == 0 ? 1 : -1);
    Eigen::Quaterniond world_from_camera =
        Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(M_PI + tilt, Eigen::Vector3d::UnitX());
    if (flight.is_forward) {
      center = Eigen::Vector3d(0, 0, 2.0 * i);
      world_from_camera = Eigen::Quaterniond::Identity();
    }
    problem.poses.push_back(Rigid3(world_from_camera, center).Inverse());
  }
  for (int i = 0; i < 1500; ++i) {
    Eigen::Vector3d point(160 * random.Uniform() - 40, 120 * random.Uniform() - 45,
                          flight.relief * (random.Uniform() - 0.5));
    if (flight.is_forward) {
      const double angle = 2 * M_PI * random.Uniform();
      point = {10 * std::cos(angle), 10 * std::sin(angle), 80 * random.Uniform()};
    }
    std::vector<CalibrationObservation> seen;
    for (size_t pose = 0; pose < problem.poses.size(); ++pose) {
      const Eigen::Vector3d x = problem.poses[pose] * point;
      if (x.z() < 1) continue;
      const Eigen::Vector2d pixel = camera.Project(x);
      if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > camera.width || pixel.y() > camera.height) continue;
      CalibrationObservation o;
      o.pose = static_cast<int>(pose);
      o.point = static_cast<int>(problem.points.size());
      o.pixel = pixel + 0.5 * Eigen::Vector2d(Gauss(&random), Gauss(&random));
      seen.push_back(o);
    }
    if (seen.size() < 2) continue;
    problem.observations.insert(problem.observations.end(), seen.begin(), seen.end());
    problem.points.push_back(point);
  }
  return problem;
}

TEST(CalibrationCost, AgreesWithTheCameraAndItsDerivativesWithDifferences) {
  Camera camera = TrueCamera();
  camera.fy = 500;
  camera.distortion[4] = 0.003;
  SteppedPoses poses({Rigid3(Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2), {0.3, -0.2, 4})});
  *Eigen::Map<Vector6d>(poses.Step(0)).data() = 0.05;
  poses.Step(0)[4] = 0.3;
  poses.PrepareForEvaluation(true, true);
  const Eigen::Vector2d pixel(300, 200);
  const CalibrationCost cost(camera, poses.At(0), pixel, 2);
  std::array<double, 3> point = {0.7, -0.4, 0.5};
  Intrinsics intrinsics = {1.03, -0.1, 0.05, 0.002, -0.003};
  const auto evaluate = [&] {
    poses.PrepareForEvaluation(true, true);
    const double* parameters[] = {poses.Step(0), point.data(), intrinsics.data()};
    Eigen::Vector2d r;
    cost.Evaluate(parameters, r.data(), nullptr);
    return r;
  };
  const Eigen::Vector3d x = poses.Result(0) * Eigen::Vector3d(0.7, -0.4, 0.5);
  EXPECT_LT((evaluate() - (WithIntrinsics(camera, intrinsics).Project(x) - pixel) / 2).norm(), 1e-9);

  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> by_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  Eigen::Matrix<double, 2, 5, Eigen::RowMajor> by_intrinsics;
  const double* parameters[] = {poses.Step(0), point.data(), intrinsics.data()};
  double* jacobians[] = {by_pose.data(), by_point.data(), by_intrinsics.data()};
  Eigen::Vector2d unused;
  cost.Evaluate(parameters, unused.data(), jacobians);
  const auto expect_derivative = [&](double* parameter, const Eigen::Vector2d& derivative, const char* what) {
    const double step = 1e-6, before = *parameter;
    *parameter = before + step;
    const Eigen::Vector2d more = evaluate();
    *parameter = before - step;
    const Eigen::Vector2d less = evaluate();
    *parameter = before;
    EXPECT_LT(((more - less) / (2 * step) - derivative).norm(), 1e-4 * (1 + derivative.norm())) << what;
  };
  for (int i = 0; i < 6; ++i) expect_derivative(poses.Step(0) + i, by_pose.col(i), "pose");
  for (int i = 0; i < 3; ++i) expect_derivative(&point[i], by_point.col(i), "point");
  for (int i = 0; i < kNumIntrinsics; ++i) expect_derivative(&intrinsics[i], by_intrinsics.col(i), "intrinsics");
}

TEST(Calibration, TiltedImagesTellTheCamera) {
  const Calibration result = CalibrateByMap({}, MakeProblem({}));
  ASSERT_TRUE(result.success) << result.reason;
  const Camera camera = TrueCamera();
  EXPECT_NEAR(result.camera.fx, camera.fx, 0.003 * camera.fx);
  EXPECT_NEAR(result.camera.fx, camera.fx, 4 * result.sigma_focal);
  EXPECT_LT(result.sigma_focal, 0.01 * camera.fx);
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(result.camera.distortion[i], camera.distortion[i], 4 * result.sigma_distortion[i]) << i;
  EXPECT_EQ(result.camera.cx, camera.cx);
  EXPECT_NEAR(result.rms_after, 0.7, 0.1) << "half a pixel in each direction, less what the unknowns take";
  EXPECT_GT(result.rms_before, result.rms_after);
}

TEST(Calibration, FlatGroundFromStraightAboveDoesNotTellTheFocalLength) {
  const Calibration result = CalibrateByMap({}, MakeProblem({.relief = 0, .tilt_deg = 0}));
  EXPECT_FALSE(result.success) << result.camera.fx << " +- " << result.sigma_focal;
  EXPECT_NE(result.reason.find("cannot be told apart"), std::string::npos) << result.reason;
}

TEST(Calibration, NorDoesReliefFromStraightAbove) {
  const Calibration result = CalibrateByMap({}, MakeProblem({.relief = 8, .tilt_deg = 0}));
  EXPECT_FALSE(result.success) << result.camera.fx << " +- " << result.sigma_focal;
}

TEST(Calibration, NorDoesAFlightStraightAhead) {
  const Calibration result = CalibrateByMap({}, MakeProblem({.is_forward = true}));
  EXPECT_FALSE(result.success) << result.camera.fx << " +- " << result.sigma_focal;
  EXPECT_NE(result.reason.find("cannot be told apart"), std::string::npos) << result.reason;
}

TEST(Calibration, OtherLensesAndSmallMapsAreRefused) {
  CalibrationProblem problem = MakeProblem({});
  problem.camera.model = Camera::Model::kFisheye;
  EXPECT_NE(CalibrateByMap({}, problem).reason.find("fisheye"), std::string::npos);
  problem.camera.model = Camera::Model::kPinhole;
  problem.observations.resize(100);
  EXPECT_NE(CalibrateByMap({}, problem).reason.find("too small"), std::string::npos);
}

}  // namespace calibration_test
}  // namespace mapmend

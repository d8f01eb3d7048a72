#include "libs/geometry/lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace mapmend {
namespace lens_test {

Camera Make(Camera::Model model, std::array<double, Camera::kMaxCoefficients> distortion, double focal = 300) {
  Camera camera;
  camera.model = model;
  camera.width = 640, camera.height = 480;
  camera.fx = focal, camera.fy = focal + 5, camera.cx = 322, camera.cy = 237;
  camera.distortion = distortion;
  return camera;
}

// Undistort undoes Project up to max_degrees from the axis, and Ray finds the very direction.
void ExpectInverse(const Camera& camera, double max_degrees) {
  SCOPED_TRACE(camera.ModelName());
  const Pinhole ideal = camera.Ideal();
  for (double angle = 0; angle <= max_degrees; angle += max_degrees / 7) {
    for (double around = 0; around < 360; around += 40) {
      const double a = angle * M_PI / 180, b = around * M_PI / 180;
      const Eigen::Vector3d ray(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      const auto found = Ray(camera, Distort(camera, ray), RadialLimit(camera));
      ASSERT_TRUE(found) << angle << " " << around;
      EXPECT_LT((*found - ray).norm(), 1e-6) << angle << " " << around;
      std::vector<bool> seen;
      const auto undistorted = camera.Undistort({camera.Project(ray).cast<float>()}, &seen);
      EXPECT_TRUE(seen[0]) << angle << " " << around;
      const double tolerance = 0.02 / (ray.z() * ray.z());
      EXPECT_LT((undistorted[0].cast<double>() - ideal.Project(ray)).norm(), tolerance) << angle << " " << around;
    }
  }
}

TEST(Lens, EveryModelIsInvertible) {
  using M = Camera::Model;
  ExpectInverse(Make(M::kPinhole, {-0.12, 0.05, 0.001, -0.0005, 0.002}), 45);
  ExpectInverse(Make(M::kFisheye, {0.02, -0.01, 0.003, -0.0005}), 80);
  ExpectInverse(Make(M::kRational, {-0.12, 0.05, 0.001, -0.0005, 0.003, 0.02, 0.001, 0.0004}), 45);
  ExpectInverse(Make(M::kRational, {-0.1, 0.05, 1e-3, 0, 0, 0, 0, 0, 1e-3, 2e-4, 1e-4, 1e-5, 0.01, 0.02}), 45);
  ExpectInverse(Make(M::kFov, {0.93}), 80);
  ExpectInverse(Make(M::kOmni, {1.7, -0.1, 0.05, 0.0003, -0.0002}, 650), 75);
  ExpectInverse(Make(M::kOmni, {0.8}, 500), 75);
  ExpectInverse(Make(M::kDoubleSphere, {-0.2, 0.6}, 180), 80);
  ExpectInverse(Make(M::kExtendedUnified, {0.6, 1.1}), 80);
  ExpectInverse(Make(M::kThinPrismFisheye, {0.003, 0.0007, 0.0001, 0.0002, 0.001, -0.0001, 0.0003, -0.0002}), 75);
  ExpectInverse(Make(M::kDivision, {-0.2}), 60);
}

TEST(Lens, AgreesWithOpenCv) {
  const std::array<double, 14> tilted = {-0.1, 0.05, 1e-3, -2e-4, 3e-3, 0.02, 1e-3,
                                         4e-4, 1e-3, 2e-4, 1e-4,  1e-5, 0.1,  0.2};
  const cv::Matx33d K(300, 0, 322, 0, 305, 237, 0, 0, 1);
  for (const int count : {8, 12, 14}) {
    auto distortion = tilted;
    std::fill(distortion.begin() + count, distortion.end(), 0);
    const Camera camera = Make(Camera::Model::kRational, distortion);
    const Eigen::Vector3d point(0.4, -0.3, 1.1);
    std::vector<cv::Point2d> seen;
    cv::projectPoints(std::vector<cv::Point3d>{{point.x(), point.y(), point.z()}}, cv::Vec3d(), cv::Vec3d(), K,
                      cv::Mat(1, count, CV_64F, distortion.data()), seen);
    EXPECT_NEAR(camera.Project(point).x(), seen[0].x, 1e-9) << count;
    EXPECT_NEAR(camera.Project(point).y(), seen[0].y, 1e-9) << count;
  }
}

TEST(Lens, AnalyticValues) {
  using M = Camera::Model;
  const Eigen::Vector3d half_right(1, 0, 1);  // 45 degrees from the axis
  // xi 1 and no distortion is the stereographic projection: 2 tan(angle / 2) / 2.
  EXPECT_NEAR(Distort(Make(M::kOmni, {1}), half_right).x(), std::tan(M_PI / 8), 1e-12);
  // A double sphere with xi 0 and alpha 0 is a pinhole; alpha 0.5 is the unified model with xi 1.
  EXPECT_NEAR(Distort(Make(M::kDoubleSphere, {0, 0}), half_right).x(), 1, 1e-12);
  EXPECT_NEAR(Distort(Make(M::kDoubleSphere, {0, 0.5}), half_right).x(), 2 * std::tan(M_PI / 8), 1e-12);
  EXPECT_NEAR(Distort(Make(M::kExtendedUnified, {0.5, 1}), half_right).x(), 2 * std::tan(M_PI / 8), 1e-12);
  // 2 r tan(w / 2) = tan(w / 2) at r = 0.5.
  EXPECT_NEAR(Distort(Make(M::kFov, {1.0}), {0.5, 0, 1}).x(), 0.5, 1e-12);
  EXPECT_NEAR(Distort(Make(M::kThinPrismFisheye, {}), half_right).x(), M_PI / 4, 1e-12);
  const Camera division = Make(M::kDivision, {-0.5});
  const auto ray = Ray(division, {1, 0}, RadialLimit(division));
  EXPECT_NEAR(ray->x() / ray->z(), 2, 1e-12);
}

TEST(Lens, TheIdealCameraIsAsLargeInTheMiddle) {
  for (const auto model : {Camera::Model::kOmni, Camera::Model::kDoubleSphere}) {
    const Camera camera = Make(model, {0.7, 0.4});
    const Eigen::Vector3d near(1e-4, 2e-4, 1);
    EXPECT_LT((camera.Project(near) - camera.Ideal().Project(near)).norm(), 1e-6);
  }
}

TEST(Lens, WhereTheCurveTurnsBackNothingIsSeen) {
  // r (1 - 0.4 r^2) is largest at r = 0.913, where it is 0.609: beyond 183 pixels from the centre there is no ray.
  const Camera camera = Make(Camera::Model::kPinhole, {-0.4});
  EXPECT_NEAR(RadialLimit(camera), std::sqrt(1 / 1.2), 0.01);
  std::vector<bool> seen;
  camera.Undistort({{322, 237}, {322 + 150, 237}, {322 + 200, 237}, {322 + 300, 237}}, &seen);
  EXPECT_EQ(seen, (std::vector<bool>{true, true, false, false}));
  // The same for a fisheye beyond 89 degrees: the lens sees it, the ideal camera cannot.
  const Camera fisheye = Make(Camera::Model::kFisheye, {}, 190);
  fisheye.Undistort({{322 + 290, 237}, {322 + 305, 237}}, &seen);
  EXPECT_EQ(seen, (std::vector<bool>{true, false}));
  EXPECT_TRUE(Ray(fisheye, {305.0 / 190, 0}, RadialLimit(fisheye)));
}

}  // namespace lens_test
}  // namespace mapmend

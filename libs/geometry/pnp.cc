#include "libs/geometry/pnp.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "libs/base/random.h"

namespace mapmend {

PnpResult SolvePnpRansac(const Pinhole& camera, const std::vector<Eigen::Vector3d>& points,
                         const std::vector<Eigen::Vector2d>& pixels, const std::vector<double>& sigmas,
                         const PnpOptions& options) {
  PnpResult best;
  const int n = static_cast<int>(points.size());
  if (n < 6) return best;
  const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  Random random(options.seed);
  const auto inliers = [&](const Rigid3& pose, std::vector<uint8_t>* mask) {
    const Eigen::Matrix3d R = pose.rotation.toRotationMatrix();
    int count = 0;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d x = R * points[i] + pose.translation;
      const double limit = options.threshold_px * sigmas[i];
      const bool ok = x.z() > 0 && (camera.Project(x) - pixels[i]).squaredNorm() < limit * limit;
      if (mask != nullptr) (*mask)[i] = ok;
      count += ok;
    }
    return count;
  };
  int iterations = options.max_iterations;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    int sample[3];
    sample[0] = random.Below(n);
    do sample[1] = random.Below(n);
    while (sample[1] == sample[0]);
    do sample[2] = random.Below(n);
    while (sample[2] == sample[0] || sample[2] == sample[1]);
    std::vector<cv::Point3d> objects;
    std::vector<cv::Point2d> images;
    for (const int i : sample) {
      objects.emplace_back(points[i].x(), points[i].y(), points[i].z());
      images.emplace_back(pixels[i].x(), pixels[i].y());
    }
    std::vector<cv::Mat> rotations, translations;
    const int solutions = cv::solveP3P(objects, images, K, cv::noArray(), rotations, translations, cv::SOLVEPNP_AP3P);
    for (int s = 0; s < solutions; ++s) {
      const Eigen::Vector3d w(rotations[s].at<double>(0), rotations[s].at<double>(1), rotations[s].at<double>(2));
      const Eigen::Vector3d t(translations[s].at<double>(0), translations[s].at<double>(1),
                              translations[s].at<double>(2));
      if (!w.allFinite() || !t.allFinite()) continue;
      const double angle = w.norm();
      const Eigen::Quaterniond q =
          angle < 1e-12 ? Eigen::Quaterniond::Identity() : Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
      const Rigid3 pose(q, t);
      const int count = inliers(pose, nullptr);
      if (count <= best.num_inliers) continue;
      best.num_inliers = count;
      best.cam_from_world = pose;
      const double all_inliers = std::pow(static_cast<double>(count) / n, 3);
      if (all_inliers > 1e-6) {
        const double needed = std::log(1 - options.confidence) / std::log(std::max(1e-12, 1 - all_inliers));
        iterations = std::min(options.max_iterations, std::max(10, static_cast<int>(std::ceil(needed))));
      }
    }
  }
  if (best.num_inliers < 6) return PnpResult{};
  best.inlier.resize(n);
  inliers(best.cam_from_world, &best.inlier);
  best.success = true;
  return best;
}

}  // namespace mapmend

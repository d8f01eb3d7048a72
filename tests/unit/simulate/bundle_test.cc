// Truth seen from outside: points tracked in rendered pictures, adjusted by mapmend's own bundle adjustment, give the
// poses back.

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "libs/optim/bundle_adjustment.h"
#include "tools/simulate/random.h"
#include "tools/simulate/simulator.h"

namespace mapmend::simulate {
namespace bundle_test {

// Root mean square of the residuals below a pixel, per coordinate; the share of those.
double Residual(const BundleProblem& problem, double* share) {
  double squares = 0;
  int inliers = 0;
  for (const BundleObservation& o : problem.observations) {
    const double chi2 =
        ReprojectionChi2(problem.cameras[0], problem.poses[o.pose].cam_from_world, problem.points[o.point], o.pixel, 1);
    if (chi2 > 1) continue;
    squares += chi2;
    ++inliers;
  }
  *share = inliers / static_cast<double>(problem.observations.size());
  return std::sqrt(squares / (2 * inliers));
}

TEST(Simulator, BundleAdjustmentOfPicturesRecoversThePoses) {
  const std::string data = std::string(MAPMEND_SOURCE_DIR) + "/data";
  Scenario scenario = ReadScenario("uav_short_uninterrupted", data + "/scenarios");
  scenario.camera = scenario.camera.Scaled(0.5);
  scenario.scene.aerial.x0 = scenario.scene.aerial.y0 = -50;
  scenario.scene.aerial.width = scenario.scene.aerial.length = 150;
  scenario.scene.aerial.texel = 0.2;
  Simulator simulator(scenario, data, 2);
  constexpr int kFrames = 8;
  std::vector<cv::Mat> pictures;
  BigVector<float> distances;  // of the first frame
  for (int i = 0; i < kFrames; ++i) {
    Frame frame;
    simulator.Render(i, &frame);
    cv::Mat grey;
    cv::cvtColor(cv::Mat(frame.height, frame.width, CV_8UC3, frame.bgr.data()), grey, cv::COLOR_BGR2GRAY);
    pictures.push_back(grey);
    if (i == 0) distances = simulator.GetRenderer().Distances();
  }
  const Pinhole camera = scenario.camera.Ideal();
  ASSERT_FALSE(scenario.camera.HasDistortion());
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(pictures[0], corners, 2000, 0.01, 5);
  // Found again by correlation within 8 pixels of where the truth expects it; where exactly is for the picture to say.
  constexpr int kHalf = 7, kSearch = 8;
  const Rigid3 first = simulator.WorldFromCamera(0);
  std::vector<std::vector<cv::Point2f>> tracks(kFrames, corners);
  std::vector<bool> good(corners.size(), true);
  for (size_t k = 0; k < corners.size(); ++k) {
    const int x = cvRound(corners[k].x), y = cvRound(corners[k].y);
    good[k] = x > kHalf && y > kHalf && x < camera.width - kHalf - 1 && y < camera.height - kHalf - 1;
    const float distance = distances[static_cast<size_t>(y) * camera.width + x];
    tracks[0][k] = cv::Point2f(static_cast<float>(x), static_cast<float>(y));
    for (int i = 1; i < kFrames && good[k]; ++i) {
      const Eigen::Vector3d point = first * (camera.Unproject(Eigen::Vector2d(x, y)).normalized() * distance);
      const Eigen::Vector2d near = camera.Project(simulator.WorldFromCamera(i).Inverse() * point);
      const int reach = kHalf + kSearch, cx = static_cast<int>(std::lround(near.x())),
                cy = static_cast<int>(std::lround(near.y()));
      good[k] = cx > reach && cy > reach && cx < camera.width - reach - 1 && cy < camera.height - reach - 1;
      if (!good[k]) break;
      cv::Mat score;
      const cv::Rect patch(x - kHalf, y - kHalf, 2 * kHalf + 1, 2 * kHalf + 1),
          area(cx - reach, cy - reach, 2 * reach + 1, 2 * reach + 1);
      cv::matchTemplate(pictures[i](area), pictures[0](patch), score, cv::TM_CCOEFF_NORMED);
      cv::Point best;
      double highest = 0;
      cv::minMaxLoc(score, nullptr, &highest, nullptr, &best);
      good[k] = highest > 0.85 && best.x > 0 && best.y > 0 && best.x < 2 * kSearch && best.y < 2 * kSearch;
      if (!good[k]) break;
      const auto vertex = [](float a, float b, float c) { return 0.5f * (a - c) / (a - 2 * b + c); };
      const float peak = score.at<float>(best);
      const float dx = vertex(score.at<float>(best.y, best.x - 1), peak, score.at<float>(best.y, best.x + 1));
      const float dy = vertex(score.at<float>(best.y - 1, best.x), peak, score.at<float>(best.y + 1, best.x));
      tracks[i][k] =
          cv::Point2f(static_cast<float>(cx - kSearch + best.x) + dx, static_cast<float>(cy - kSearch + best.y) + dy);
    }
  }
  // Begin far off: poses by about half a metre and half a degree, points by 3 m in depth. First and last pose hold the
  // gauge.
  BundleProblem problem;
  problem.cameras = {camera};
  Random random(4);
  for (int i = 0; i < kFrames; ++i) {
    Rigid3 world_from_camera = simulator.WorldFromCamera(i);
    const bool fixed = i == 0 || i + 1 == kFrames;
    if (!fixed) {
      const Eigen::Vector3d turn(random.Gaussian(), random.Gaussian(), random.Gaussian());
      const Eigen::Vector3d shift(random.Gaussian(), random.Gaussian(), random.Gaussian());
      world_from_camera.rotation =
          world_from_camera.rotation * Eigen::Quaterniond(Eigen::AngleAxisd(0.005 * turn.norm(), turn.normalized()));
      world_from_camera.translation += 0.3 * shift;
    }
    problem.poses.push_back({world_from_camera.Inverse(), fixed, 0});
  }
  for (size_t k = 0; k < corners.size(); ++k) {
    if (!good[k]) continue;
    const Eigen::Vector3d ray = camera.Unproject(Eigen::Vector2d(tracks[0][k].x, tracks[0][k].y)).normalized();
    const size_t pixel = static_cast<size_t>(tracks[0][k].y) * camera.width + static_cast<size_t>(tracks[0][k].x);
    const int point = static_cast<int>(problem.points.size());
    problem.points.push_back(first * (ray * (distances[pixel] + 3 * random.Gaussian())));
    for (int i = 0; i < kFrames; ++i) problem.observations.push_back({i, point, {tracks[i][k].x, tracks[i][k].y}, 0.2});
  }
  ASSERT_GT(problem.points.size(), 100u);
  BundleOptions options;
  options.max_iterations = 100;
  options.function_tolerance = 1e-9;
  // Once more with the true poses and only the points free.
  BundleProblem with_truth = problem;
  for (int i = 0; i < kFrames; ++i) with_truth.poses[i] = {simulator.WorldFromCamera(i).Inverse(), true, 0};
  ASSERT_TRUE(AdjustBundle(options, &problem).success);
  ASSERT_TRUE(AdjustBundle(options, &with_truth).success);
  double inliers = 0, true_inliers = 0;
  const double noise = Residual(problem, &inliers), true_noise = Residual(with_truth, &true_inliers);

  double position = 0, angle = 0;
  for (int i = 1; i + 1 < kFrames; ++i) {
    const Rigid3 truth = simulator.WorldFromCamera(i), found = problem.poses[i].cam_from_world.Inverse();
    position = std::max(position, (found.translation - truth.translation).norm());
    angle = std::max(angle, found.rotation.angularDistance(truth.rotation) * 180 / 3.14159265358979);
  }
  std::printf("points %zu, noise %.3f px, with the true poses %.3f px, largest error %.3f m, %.3f degrees\n",
              problem.points.size(), noise, true_noise, position, angle);
  EXPECT_GT(inliers, 0.95);
  EXPECT_GT(true_inliers, 0.95);
  EXPECT_LT(noise, 0.15);
  EXPECT_LT(true_noise, 1.15 * noise) << "the true poses must explain the pictures as well as the best poses do";
  // One pixel is 75 m / 305 = 0.25 m on the ground. Over even ground a shift and a tilt look nearly the same, and the
  // baseline is short: half a pixel of each may hide in the noise of a tenth.
  EXPECT_LT(position, 0.15);
  EXPECT_LT(angle, 0.12);
}

}  // namespace bundle_test
}  // namespace mapmend::simulate

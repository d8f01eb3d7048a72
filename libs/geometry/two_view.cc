#include "libs/geometry/two_view.h"

#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "libs/base/random.h"

namespace mapmend {
namespace {

Eigen::Matrix3d ToEigen(const cv::Mat& m) {
  Eigen::Matrix3d e;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) e(r, c) = m.at<double>(r, c);
  }
  return e;
}

void Add(TwoViewModel model, const cv::Mat& R, const Eigen::Vector3d& t, std::vector<TwoViewHypothesis>* hypotheses) {
  if (t.norm() < 1e-9 || !t.allFinite()) return;
  const Eigen::Matrix3d rotation = ToEigen(R);
  if (rotation.determinant() < 0) return;
  hypotheses->push_back({model, Rigid3(rotation, t.normalized())});
}

Eigen::Vector3d ToVector(const cv::Mat& t) { return {t.at<double>(0), t.at<double>(1), t.at<double>(2)}; }

}  // namespace

std::vector<TwoViewHypothesis> ProposeTwoViewMotions(const std::vector<Eigen::Vector2d>& first,
                                                     const std::vector<Eigen::Vector2d>& second, double threshold,
                                                     uint64_t seed) {
  std::vector<TwoViewHypothesis> hypotheses;
  if (first.size() < 8 || first.size() != second.size()) return hypotheses;
  std::vector<int> order(first.size());
  std::iota(order.begin(), order.end(), 0);
  Random(seed).Shuffle(&order);
  std::vector<cv::Point2d> a, b;
  for (const int i : order) {
    a.emplace_back(first[i].x(), first[i].y());
    b.emplace_back(second[i].x(), second[i].y());
  }
  const cv::Mat H = cv::findHomography(a, b, cv::RANSAC, threshold * 1.5, cv::noArray(), 2000, 0.999);
  if (!H.empty()) {
    std::vector<cv::Mat> R, t, n;
    cv::decomposeHomographyMat(H, cv::Mat::eye(3, 3, CV_64F), R, t, n);
    for (size_t i = 0; i < R.size(); ++i) Add(TwoViewModel::kHomography, R[i], ToVector(t[i]), &hypotheses);
  }
  const cv::Mat E = cv::findEssentialMat(a, b, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, 0.999, threshold);
  if (E.rows == 3 && E.cols == 3) {
    cv::Mat R1, R2, t;
    cv::decomposeEssentialMat(E, R1, R2, t);
    for (const cv::Mat& R : {R1, R2}) {
      for (const double sign : {1.0, -1.0}) Add(TwoViewModel::kEssential, R, sign * ToVector(t), &hypotheses);
    }
  }
  return hypotheses;
}

}  // namespace mapmend

#include "libs/connecting/seam.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "libs/base/text_format.h"
#include "libs/connecting/local_window.h"
#include "libs/stream/revision.h"

namespace mapmend {
namespace {

double SigmaOfPlace(const Similarity3& b_from_a, const Eigen::Vector3d& point_in_a, const Matrix7d& covariance) {
  const Eigen::Matrix<double, 3, 7> jacobian = PlaceJacobian(b_from_a, point_in_a);
  return std::sqrt(std::max(0.0, (jacobian * covariance * jacobian.transpose()).trace()));
}

double Extent(const Submap& submap) {
  Eigen::AlignedBox3d box;
  for (const auto& [id, keyframe] : submap.keyframes) box.extend(keyframe.cam_from_submap.Center());
  if (box.isEmpty()) return 0;
  return std::max(box.diagonal().norm(), MedianDepth(submap, submap.keyframes.begin()->second));
}

}  // namespace

Matrix7d TransformCovariance(const Matrix7d& information, double median_error_px) {
  constexpr double kMedianOfSigma = 1.18;  // of the length of an error in two dimensions, sigma 1
  const double inflation = std::max(1.0, median_error_px / kMedianOfSigma);
  const Eigen::SelfAdjointEigenSolver<Matrix7d> eigen(information);
  constexpr double kUnknown = 1e12;  // far beyond any variance that means something
  if (eigen.info() != Eigen::Success) return kUnknown * Matrix7d::Identity();
  constexpr double kLeast = 1e-12;  // of the largest: beyond, nothing is known
  const double least = std::max(kLeast * eigen.eigenvalues().maxCoeff(), 1e-300);
  const Vector7d inverse = eigen.eigenvalues().cwiseMax(least).cwiseInverse();
  return inflation * inflation * (eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose());
}

RelationSigmas SigmasAt(const Similarity3& b_from_a, const Matrix7d& covariance, const Eigen::Vector3d& center,
                        double depth) {
  return {std::sqrt(std::max(0.0, covariance.topLeftCorner<3, 3>().trace() / 3)),
          SigmaOfPlace(b_from_a, center, covariance) / std::sqrt(3.0) / depth,
          std::sqrt(std::max(0.0, covariance(6, 6)))};
}

FarEnd FindFarEnd(const Submap& a, const Submap& b, const Similarity3& b_from_a, const Matrix7d& covariance) {
  FarEnd worst;
  const double extent_a = b_from_a.scale * Extent(a), extent_b = Extent(b);
  const auto consider = [&](const Eigen::Vector3d& center_in_a, double extent, bool is_of_a) {
    const double share = extent > 0 ? SigmaOfPlace(b_from_a, center_in_a, covariance) / extent : 0;
    if (share > worst.share) worst = {share, is_of_a};
  };
  for (const auto& [id, keyframe] : a.keyframes) consider(keyframe.cam_from_submap.Center(), extent_a, true);
  const Similarity3 a_from_b = b_from_a.Inverse();
  for (const auto& [id, keyframe] : b.keyframes)
    consider(a_from_b * keyframe.cam_from_submap.Center(), extent_b, false);
  return worst;
}

std::string DescribeWeakness(const FarEnd& far_end) {
  return kWeakReason + Format("by itself it leaves the far end of the %s submap open by %.1f %% of its extent",
                              far_end.is_of_a ? "older" : "younger", 100 * far_end.share);
}

}  // namespace mapmend

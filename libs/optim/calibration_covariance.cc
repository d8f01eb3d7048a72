#include "libs/optim/calibration_covariance.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <map>
#include <utility>

#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

constexpr double kHeld = 1e6;          // weight of what is held, relative to the largest diagonal element
constexpr double kLeastPivot = 1e-13;  // of a point's equations, relative: below it the point is left out

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct PointEquations {
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  bool is_solvable = false;
  std::map<int, Eigen::Matrix<double, 6, 3>> by_pose;  // by pose: J_pose^T J_point
  Eigen::Matrix<double, kNumIntrinsics, 3> by_intrinsics = Eigen::Matrix<double, kNumIntrinsics, 3>::Zero();
};

class ReducedSystem {
 public:
  ReducedSystem(size_t num_poses, const std::vector<CalibrationRow>& rows, size_t num_points)
      : with_intrinsics_(num_poses, PoseIntrinsics::Zero()), points_(num_points) {
    std::vector<Eigen::Matrix3d> hessians(num_points, Eigen::Matrix3d::Zero());
    for (const CalibrationRow& row : rows) {
      BlockOf(row.pose, row.pose) += row.by_pose.transpose() * row.by_pose;
      with_intrinsics_[row.pose] += row.by_pose.transpose() * row.by_intrinsics;
      intrinsics_ += row.by_intrinsics.transpose() * row.by_intrinsics;
      hessians[row.point] += row.by_point.transpose() * row.by_point;
      PointEquations& point = points_[row.point];
      const auto [it, is_new] = point.by_pose.try_emplace(row.pose, Eigen::Matrix<double, 6, 3>::Zero());
      it->second += row.by_pose.transpose() * row.by_point;
      point.by_intrinsics += row.by_intrinsics.transpose() * row.by_point;
    }
    for (size_t i = 0; i < num_points; ++i) Eliminate(hessians[i], &points_[i]);
  }

  // The upper triangle; intrinsics come last. Held are pose 0 and what the gradient tells.
  Eigen::SparseMatrix<double> Matrix(const Eigen::VectorXd& scale_gradient) const {
    const int at = IntrinsicsAt(), size = at + kNumIntrinsics;
    std::vector<Eigen::Triplet<double>> triplets;
    double largest = 0;
    const auto add = [&](int row, int column, const auto& block) {
      for (int i = 0; i < block.rows(); ++i) {
        for (int j = 0; j < block.cols(); ++j) {
          if (row + i <= column + j) triplets.emplace_back(row + i, column + j, block(i, j));
          if (row + i == column + j) largest = std::max(largest, block(i, j));
        }
      }
    };
    for (const auto& [pair, block] : blocks_) add(6 * pair.first, 6 * pair.second, block);
    for (size_t i = 0; i < with_intrinsics_.size(); ++i) add(6 * static_cast<int>(i), at, with_intrinsics_[i]);
    add(at, at, intrinsics_);
    const double held = kHeld * largest;
    for (int i = 0; i < 6; ++i) triplets.emplace_back(i, i, held);
    for (int i = 0; i < at; ++i) {
      for (int j = i; j < at && scale_gradient[i] != 0; ++j) {
        if (scale_gradient[j] != 0) triplets.emplace_back(i, j, held * scale_gradient[i] * scale_gradient[j]);
      }
    }
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(triplets.begin(), triplets.end());
    return matrix;
  }

  // How the points follow the others.
  void FollowPoints(Eigen::VectorXd* step) const {
    const int at = IntrinsicsAt();
    for (size_t i = 0; i < points_.size(); ++i) {
      const PointEquations& point = points_[i];
      if (!point.is_solvable) continue;
      Eigen::Vector3d right = point.by_intrinsics.transpose() * step->segment<kNumIntrinsics>(at);
      for (const auto& [pose, block] : point.by_pose)
        right += block.transpose() * step->segment<6>(Eigen::Index{6} * pose);
      step->segment<3>(at + kNumIntrinsics + 3 * static_cast<Eigen::Index>(i)) = -point.inverse * right;
    }
  }

 private:
  using PoseIntrinsics = Eigen::Matrix<double, 6, kNumIntrinsics>;

  int IntrinsicsAt() const { return 6 * static_cast<int>(with_intrinsics_.size()); }
  Matrix6d& BlockOf(int a, int b) { return blocks_.try_emplace({a, b}, Matrix6d::Zero()).first->second; }

  void Eliminate(const Eigen::Matrix3d& hessian, PointEquations* point) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(hessian);
    point->is_solvable = solver.eigenvalues()[0] > kLeastPivot * solver.eigenvalues()[2];
    if (!point->is_solvable) return;
    point->inverse = hessian.inverse();
    for (auto a = point->by_pose.begin(); a != point->by_pose.end(); ++a) {
      const Eigen::Matrix<double, 6, 3> left = a->second * point->inverse;
      for (auto b = a; b != point->by_pose.end(); ++b) BlockOf(a->first, b->first) -= left * b->second.transpose();
      with_intrinsics_[a->first] -= left * point->by_intrinsics.transpose();
    }
    intrinsics_ -= point->by_intrinsics * point->inverse * point->by_intrinsics.transpose();
  }

  std::map<std::pair<int, int>, Matrix6d> blocks_;  // by poses a <= b
  std::vector<PoseIntrinsics> with_intrinsics_;     // by pose
  Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics> intrinsics_ =
      Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics>::Zero();
  std::vector<PointEquations> points_;
};

}  // namespace

CalibrationLinearisation::CalibrationLinearisation(const std::vector<Rigid3>& poses, size_t num_points)
    : num_poses_(poses.size()), num_points_(num_points), scale_gradient_(Eigen::VectorXd::Zero(6 * poses.size())) {
  const Eigen::Vector3d start = poses.front().Center();
  const auto farthest = std::max_element(poses.begin(), poses.end(), [&](const Rigid3& a, const Rigid3& b) {
    return (a.Center() - start).norm() < (b.Center() - start).norm();
  });
  const Eigen::Vector3d way = farthest->Center() - start;
  if (way.norm() <= 0) return;
  // Centre = -R^T t. Of a step (dt, dw) with R' = exp(dw) R: d centre = -R^T (dt + [t]x dw).
  const Eigen::Matrix3d R = farthest->rotation.toRotationMatrix();
  const Eigen::RowVector3d along = -way.normalized().transpose() * R.transpose();
  const auto at = 6 * (farthest - poses.begin());
  scale_gradient_.segment<3>(at) = along.transpose();
  scale_gradient_.segment<3>(at + 3) = (along * Skew(farthest->translation)).transpose();
}

std::optional<Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics>> CalibrationLinearisation::Covariance() const {
  const ReducedSystem system(num_poses_, rows_, num_points_);
  const Eigen::SparseMatrix<double> matrix = system.Matrix(scale_gradient_);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Upper> solver(matrix);
  if (solver.info() != Eigen::Success || solver.vectorD().minCoeff() <= 0) return std::nullopt;
  const int at = static_cast<int>(6 * num_poses_);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(at + kNumIntrinsics, kNumIntrinsics);
  right.bottomRows<kNumIntrinsics>().setIdentity();
  const Eigen::MatrixXd columns = solver.solve(right);
  const Eigen::Matrix<double, kNumIntrinsics, kNumIntrinsics> covariance = columns.bottomRows<kNumIntrinsics>();
  if (!covariance.allFinite() || covariance.diagonal().minCoeff() <= 0) return std::nullopt;
  direction_ = Eigen::VectorXd::Zero(at + kNumIntrinsics + 3 * static_cast<int>(num_points_));
  direction_.head(at + kNumIntrinsics) = columns.col(0) / covariance(0, 0);
  system.FollowPoints(&direction_);
  return covariance;
}

Eigen::VectorXd CalibrationLinearisation::Direction() const { return direction_; }

}  // namespace mapmend

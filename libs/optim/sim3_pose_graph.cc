#include "libs/optim/sim3_pose_graph.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <cmath>

#include "libs/optim/position_prior.h"

namespace mapmend {
namespace {

// Residual of b_from_a against its measurement; parameters per vertex: quaternion, translation, log scale of
// root_from_vertex.
struct RelationCost {
  explicit RelationCost(const PoseGraphEdge& e)
      : rotation(e.b_from_a.rotation),
        translation(e.b_from_a.translation),
        log_scale(std::log(e.b_from_a.scale)),
        weight_rotation(1 / e.sigma_rotation),
        weight_translation(1 / e.sigma_translation),
        weight_scale(1 / e.sigma_scale) {}

  template <typename T>
  bool operator()(const T* qa, const T* ta, const T* sa, const T* qb, const T* tb, const T* sb, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> rotation_a(qa), rotation_b(qb);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation_a(ta), translation_b(tb);
    const Eigen::Quaternion<T> inverse_b = rotation_b.conjugate();
    // Where a's origin lies in b, and how a is turned and scaled there.
    const Eigen::Matrix<T, 3, 1> origin = (inverse_b * (translation_a - translation_b)) * ceres::exp(-sb[0]);
    Eigen::Quaternion<T> turn = (inverse_b * rotation_a) * rotation.conjugate().template cast<T>();
    if (turn.w() < T(0)) turn.coeffs() *= T(-1);
    Eigen::Map<Eigen::Matrix<T, 7, 1>> r(residual);
    r.template head<3>() = T(2 * weight_rotation) * turn.vec();
    r.template segment<3>(3) = T(weight_translation) * (origin - translation.template cast<T>());
    r(6) = T(weight_scale) * (sa[0] - sb[0] - T(log_scale));
    return true;
  }

  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  double log_scale, weight_rotation, weight_translation, weight_scale;
};

// Of the translation of root_from_vertex.
struct VertexPositionCost {
  template <typename T>
  bool operator()(const T* t, T* residual) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(t);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = prior.whitening.template cast<T>() * (translation - prior.position.template cast<T>());
    return true;
  }

  PositionPrior prior;
};

struct Vertex {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  double log_scale;
};

}  // namespace

PoseGraphSummary OptimizePoseGraph(const std::vector<PoseGraphEdge>& edges, int fixed, const PoseGraphOptions& options,
                                   std::vector<Similarity3>* root_from_vertex,
                                   const std::vector<PositionPrior>* positions) {
  PoseGraphSummary result;
  if (edges.empty()) return result;
  std::vector<Vertex> vertices;
  for (const Similarity3& s : *root_from_vertex) vertices.push_back({s.rotation, s.translation, std::log(s.scale)});

  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::EigenQuaternionManifold manifold;
  ceres::CauchyLoss cauchy(options.cauchy);
  ceres::Problem problem(problem_options);
  for (const PoseGraphEdge& e : edges) {
    Vertex &a = vertices[e.a], &b = vertices[e.b];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<RelationCost, 7, 4, 3, 1, 4, 3, 1>(new RelationCost(e)),
                             e.robust ? &cauchy : nullptr, a.rotation.coeffs().data(), a.translation.data(),
                             &a.log_scale, b.rotation.coeffs().data(), b.translation.data(), &b.log_scale);
  }
  ceres::CauchyLoss position_loss(kPositionCauchy);
  if (positions != nullptr) {
    for (const PositionPrior& prior : *positions) {
      double* translation = vertices[prior.pose].translation.data();
      if (!problem.HasParameterBlock(translation)) continue;
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<VertexPositionCost, 3, 3>(new VertexPositionCost{prior}),
                               &position_loss, translation);
    }
  }
  for (size_t v = 0; v < vertices.size(); ++v) {
    if (!problem.HasParameterBlock(&vertices[v].log_scale)) continue;
    problem.SetManifold(vertices[v].rotation.coeffs().data(), &manifold);
    if (static_cast<int>(v) == fixed) {
      problem.SetParameterBlockConstant(vertices[v].rotation.coeffs().data());
      problem.SetParameterBlockConstant(vertices[v].translation.data());
      problem.SetParameterBlockConstant(&vertices[v].log_scale);
    }
  }
  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver_options.max_num_iterations = options.max_iterations;
  solver_options.num_threads = 1;
  solver_options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  result.num_iterations = static_cast<int>(summary.iterations.size());
  result.initial_cost = summary.initial_cost;
  result.final_cost = summary.final_cost;
  result.success = summary.IsSolutionUsable();
  if (!result.success) return result;
  for (size_t v = 0; v < vertices.size(); ++v) {
    (*root_from_vertex)[v] =
        Similarity3(std::exp(vertices[v].log_scale), vertices[v].rotation, vertices[v].translation);
  }
  return result;
}

}  // namespace mapmend

#include "libs/geometry/sim3_ransac.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "libs/base/options.h"
#include "libs/geometry/sim3_closed_form.h"

namespace mapmend {
namespace {

struct Support {
  std::vector<char> is_inlier;
  int num_inliers = 0;
  double cost = 0;  // sum of truncated squared errors (MSAC): tells models of equal count apart
};

Support Evaluate(const std::vector<PointMatch>& matches, const Similarity3& b_from_a, double max_squared_error) {
  Support support;
  support.is_inlier.resize(matches.size());
  const Similarity3 a_from_b = b_from_a.Inverse();
  for (size_t i = 0; i < matches.size(); ++i) {
    const double e = std::max(SquaredError(matches[i].a_in_b, b_from_a), SquaredError(matches[i].b_in_a, a_from_b));
    support.is_inlier[i] = e <= max_squared_error;
    support.num_inliers += support.is_inlier[i];
    support.cost += std::min(e, max_squared_error);
  }
  return support;
}

std::optional<Similarity3> Fit(const std::vector<PointMatch>& matches, const std::vector<char>& use) {
  std::vector<Eigen::Vector3d> a, b;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!use[i]) continue;
    a.push_back(matches[i].a_in_b.point);
    b.push_back(matches[i].b_in_a.point);
  }
  return HornAlignment(a, b);
}

// Three different indices below n. Plain modulo: std::uniform_int_distribution differs between libraries.
std::array<size_t, 3> Sample(std::mt19937_64* random, size_t n) {
  std::array<size_t, 3> s;
  s[0] = (*random)() % n;
  do s[1] = (*random)() % n;
  while (s[1] == s[0]);
  do s[2] = (*random)() % n;
  while (s[2] == s[0] || s[2] == s[1]);
  return s;
}

int NumIterationsNeeded(double inlier_ratio, double confidence) {
  const double all_good = inlier_ratio * inlier_ratio * inlier_ratio;
  if (all_good >= 1 - 1e-9) return 1;
  return static_cast<int>(std::ceil(std::min(1e6, std::log(1 - confidence) / std::log(1 - all_good))));
}

}  // namespace

std::string Sim3RansacOptions::Check() const { return CheckOptions(*this); }

Sim3RansacResult EstimateSim3(const std::vector<PointMatch>& matches, const Sim3RansacOptions& options) {
  Sim3RansacResult result;
  const size_t n = matches.size();
  if (n < 3 || static_cast<int>(n) < options.min_inliers) return result;
  const auto plausible = [&](const std::optional<Similarity3>& t) {
    return t && t->scale <= options.max_scale && t->scale >= 1 / options.max_scale;
  };

  std::mt19937_64 random(options.seed);
  Support best;
  best.cost = std::numeric_limits<double>::infinity();
  Similarity3 best_model;
  int needed = options.max_iterations;
  for (; result.num_iterations < std::min(needed, options.max_iterations); ++result.num_iterations) {
    const std::array<size_t, 3> sample = Sample(&random, n);
    std::vector<Eigen::Vector3d> a, b;
    for (const size_t i : sample) {
      a.push_back(matches[i].a_in_b.point);
      b.push_back(matches[i].b_in_a.point);
    }
    std::optional<Similarity3> model = HornAlignment(a, b);
    if (!plausible(model)) continue;
    Support support = Evaluate(matches, *model, options.max_squared_error);
    if (support.num_inliers < 3 || support.cost >= best.cost) continue;
    // Three noisy points make a poor model; all its inliers make a better one, which finds more.
    for (int round = 0; round < 3; ++round) {
      const std::optional<Similarity3> refit = Fit(matches, support.is_inlier);
      if (!plausible(refit)) break;
      Support refit_support = Evaluate(matches, *refit, options.max_squared_error);
      if (refit_support.cost >= support.cost) break;
      model = refit;
      support = std::move(refit_support);
    }
    best = std::move(support);
    best_model = *model;
    needed = NumIterationsNeeded(static_cast<double>(best.num_inliers) / static_cast<double>(n), options.confidence);
  }
  result.b_from_a = best_model;
  result.is_inlier = std::move(best.is_inlier);
  result.num_inliers = best.num_inliers;
  result.success = best.num_inliers >= options.min_inliers;
  return result;
}

}  // namespace mapmend

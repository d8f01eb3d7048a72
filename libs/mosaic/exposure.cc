#include "libs/mosaic/exposure.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>

namespace mapmend {
namespace {

constexpr float kDarkest = 8, kBrightest = 247;  // what is darker or brighter is clipped, and tells no gain

bool IsUsable(const BrightnessSample& sample) {
  return std::all_of(sample.color.begin(), sample.color.end(), [](float c) { return c > kDarkest && c < kBrightest; });
}

// log gain of the two images and the vignetting at both ends, for two images of one place.
struct Equation {
  int first = 0, second = 0;
  double r2_first = 0, r2_second = 0;
  std::array<double, 3> difference = {};  // log first - log second
};

std::vector<Equation> Equations(const std::vector<std::vector<BrightnessSample>>& places) {
  std::vector<Equation> equations;
  for (const std::vector<BrightnessSample>& place : places) {
    const BrightnessSample* last = nullptr;
    for (const BrightnessSample& sample : place) {
      if (!IsUsable(sample)) continue;
      if (last != nullptr) {
        Equation e{last->image, sample.image, last->offset * last->offset, sample.offset * sample.offset, {}};
        for (size_t c = 0; c < 3; ++c) e.difference[c] = std::log(last->color[c]) - std::log(sample.color[c]);
        equations.push_back(e);
      }
      last = &sample;
    }
  }
  return equations;
}

}  // namespace

float Exposure::Vignetting(float offset) const {
  const double r2 = static_cast<double>(offset) * offset;
  return static_cast<float>(std::exp(a * r2 + b * r2 * r2));
}

Exposure SolveExposure(int num_images, const std::vector<std::vector<BrightnessSample>>& places,
                       const ExposureOptions& options) {
  const std::vector<Equation> equations = Equations(places);
  const int n = num_images, num_unknowns = 3 * n + 2;  // log gains by channel, then a and b
  Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns);
  for (int round = 0; round < options.num_rounds && !equations.empty(); ++round) {
    constexpr size_t kEntriesOfEquation = 3 * 16;
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(static_cast<size_t>(num_unknowns) + kEntriesOfEquation * equations.size());
    Eigen::VectorXd g = Eigen::VectorXd::Zero(num_unknowns);
    for (int i = 0; i < 3 * n; ++i) entries.emplace_back(i, i, 1 / (options.prior_sigma * options.prior_sigma));
    for (int i = 3 * n; i < num_unknowns; ++i)
      entries.emplace_back(i, i, 1 / (options.vignetting_sigma * options.vignetting_sigma));
    for (const Equation& e : equations) {
      const std::array<double, 2> r = {e.r2_first - e.r2_second, e.r2_first * e.r2_first - e.r2_second * e.r2_second};
      for (int c = 0; c < 3; ++c) {
        const std::array<int, 4> at = {c * n + e.first, c * n + e.second, 3 * n, 3 * n + 1};
        const std::array<double, 4> jacobian = {1, -1, r[0], r[1]};
        double residual = -e.difference[static_cast<size_t>(c)];
        for (size_t k = 0; k < at.size(); ++k) residual += jacobian[k] * x[at[k]];
        const double weight = std::min(1.0, options.huber / std::max(1e-12, std::abs(residual)));
        for (size_t k = 0; k < at.size(); ++k) {
          g[at[k]] += weight * jacobian[k] * e.difference[static_cast<size_t>(c)];
          for (size_t l = 0; l < at.size(); ++l) entries.emplace_back(at[k], at[l], weight * jacobian[k] * jacobian[l]);
        }
      }
    }
    Eigen::SparseMatrix<double> H(num_unknowns, num_unknowns);
    H.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(H);
    if (solver.info() != Eigen::Success) break;
    x = solver.solve(g);
  }
  Exposure exposure;
  exposure.gains.resize(static_cast<size_t>(n));
  for (int i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c)
      exposure.gains[static_cast<size_t>(i)][static_cast<size_t>(c)] = static_cast<float>(std::exp(x[c * n + i]));
  }
  exposure.a = x[num_unknowns - 2];
  exposure.b = x[num_unknowns - 1];
  return exposure;
}

}  // namespace mapmend

#include "libs/mosaic/exposure.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace mapmend {
namespace {

bool IsUsable(const BrightnessSample& sample) {
  return std::all_of(sample.color.begin(), sample.color.end(), [](float c) { return c > kDarkest && c < kBrightest; });
}

// log gain of the two images and the vignetting at both ends, for two images of one place.
struct Equation {
  int first = 0, second = 0, pair = 0;    // pair: index of these two images
  Eigen::Vector2d r;                      // what the vignetting's a and b are multiplied with
  std::array<double, 3> difference = {};  // log first - log second
};

class Equations {
 public:
  explicit Equations(const std::vector<std::vector<BrightnessSample>>& places) {
    std::map<std::pair<int, int>, int> indices;
    for (const std::vector<BrightnessSample>& place : places) {
      const BrightnessSample* last = nullptr;
      for (const BrightnessSample& sample : place) {
        if (!IsUsable(sample)) continue;
        if (last != nullptr) {
          const auto pair = indices.try_emplace({last->image, sample.image}, static_cast<int>(pairs_.size()));
          if (pair.second) pairs_.push_back(pair.first->first);
          Add(*last, sample, pair.first->second);
        }
        last = &sample;
      }
    }
  }

  const std::vector<Equation>& All() const { return all_; }
  const std::vector<std::pair<int, int>>& Pairs() const { return pairs_; }

 private:
  void Add(const BrightnessSample& first, const BrightnessSample& second, int pair) {
    Equation& e = all_.emplace_back();
    e.first = first.image;
    e.second = second.image;
    e.pair = pair;
    const double r2_first = first.offset * first.offset, r2_second = second.offset * second.offset;
    e.r = {r2_first - r2_second, r2_first * r2_first - r2_second * r2_second};
    for (size_t c = 0; c < 3; ++c) e.difference[c] = std::log(first.color[c]) - std::log(second.color[c]);
  }

  std::vector<Equation> all_;
  std::vector<std::pair<int, int>> pairs_;
};

// The normal equations of log gains (channel by channel) and, last, a and b. Sums are kept for each pair of images, not
// for each place that they share: a flight of many images shares many.
class NormalEquations {
 public:
  NormalEquations(int num_images, const Equations& equations, const ExposureOptions& options)
      : n_(num_images),
        pairs_(equations.Pairs()),
        of_image_(Eigen::VectorXd::Constant(Eigen::Index{3} * n_, 1 / (options.prior_sigma * options.prior_sigma))),
        of_pair_(Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(pairs_.size()))),
        with_vignetting_(Eigen::MatrixX2d::Zero(Eigen::Index{3} * n_, 2)),
        vignetting_(Eigen::Matrix2d::Identity() / (options.vignetting_sigma * options.vignetting_sigma)),
        g_(Eigen::VectorXd::Zero(Eigen::Index{3} * n_ + 2)) {}

  void Add(const Equation& e, int channel, double weight) {
    const int first = channel * n_ + e.first, second = channel * n_ + e.second;
    const double difference = weight * e.difference[static_cast<size_t>(channel)];
    of_image_[first] += weight;
    of_image_[second] += weight;
    of_pair_[channel * static_cast<int>(pairs_.size()) + e.pair] -= weight;
    with_vignetting_.row(first) += weight * e.r.transpose();
    with_vignetting_.row(second) -= weight * e.r.transpose();
    vignetting_ += weight * e.r * e.r.transpose();
    g_[first] += difference;
    g_[second] -= difference;
    g_.tail<2>() += difference * e.r;
  }

  // Empty if there is none.
  Eigen::VectorXd Solve() const {
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int row, int column, double value) {
      entries.emplace_back(row, column, value);
      if (row != column) entries.emplace_back(column, row, value);
    };
    for (int i = 0; i < 3 * n_; ++i) {
      add(i, i, of_image_[i]);
      for (int k = 0; k < 2; ++k) add(i, 3 * n_ + k, with_vignetting_(i, k));
    }
    const int num_pairs = static_cast<int>(pairs_.size());
    for (int c = 0; c < 3; ++c) {
      for (int p = 0; p < num_pairs; ++p)
        add(c * n_ + pairs_[static_cast<size_t>(p)].first, c * n_ + pairs_[static_cast<size_t>(p)].second,
            of_pair_[c * num_pairs + p]);
    }
    add(3 * n_, 3 * n_, vignetting_(0, 0));
    add(3 * n_, 3 * n_ + 1, vignetting_(0, 1));
    add(3 * n_ + 1, 3 * n_ + 1, vignetting_(1, 1));
    Eigen::SparseMatrix<double> H(3 * n_ + 2, 3 * n_ + 2);
    H.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(H);
    if (solver.info() != Eigen::Success) return {};
    return solver.solve(g_);
  }

 private:
  const int n_;
  const std::vector<std::pair<int, int>>& pairs_;
  Eigen::VectorXd of_image_, of_pair_;
  Eigen::MatrixX2d with_vignetting_;
  Eigen::Matrix2d vignetting_;
  Eigen::VectorXd g_;
};

}  // namespace

float Exposure::Vignetting(float offset) const {
  const double r2 = static_cast<double>(offset) * offset;
  return static_cast<float>(std::exp(a * r2 + b * r2 * r2));
}

Exposure SolveExposure(int num_images, const std::vector<std::vector<BrightnessSample>>& places,
                       const ExposureOptions& options) {
  const Equations equations(places);
  const int n = num_images, num_unknowns = 3 * n + 2;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns);
  for (int round = 0; round < options.num_rounds && !equations.All().empty(); ++round) {
    NormalEquations normal(n, equations, options);
    for (const Equation& e : equations.All()) {
      for (int c = 0; c < 3; ++c) {
        const double residual =
            x[c * n + e.first] - x[c * n + e.second] + e.r.dot(x.tail<2>()) - e.difference[static_cast<size_t>(c)];
        normal.Add(e, c, std::min(1.0, options.huber / std::max(1e-12, std::abs(residual))));
      }
    }
    const Eigen::VectorXd solution = normal.Solve();
    if (solution.size() == 0) break;
    x = solution;
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

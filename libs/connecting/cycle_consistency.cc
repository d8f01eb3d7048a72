#include "libs/connecting/cycle_consistency.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "libs/base/median.h"
#include "libs/base/options.h"
#include "libs/connecting/merged_transforms.h"

namespace mapmend {
namespace {

Eigen::Vector3d Centroid(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

// Standard deviation of where an edge puts a point, units of its b, from the information of its estimate.
double PlacementSigma(const CycleEdge& edge, const Eigen::Vector3d& x_a) {
  const Eigen::LDLT<Matrix7d> ldlt(edge.information);
  if (!ldlt.isPositive() || ldlt.vectorD().minCoeff() <= 0) return 0;
  const Eigen::Matrix<double, 3, 7> J = PlaceJacobian(edge.b_from_a, x_a);
  const Eigen::Matrix3d covariance = J * ldlt.solve(J.transpose());
  return std::sqrt(std::max(0.0, covariance.trace() / 3));
}

// Edges of the tree path from vertex `from` to `to`, in order.
std::vector<int> TreePath(const std::vector<std::vector<int>>& tree_edges_of, const std::vector<CycleEdge>& edges,
                          int from, int to) {
  std::vector<int> via(tree_edges_of.size(), -1);
  std::vector<int> open = {from};
  std::vector<char> seen(tree_edges_of.size(), 0);
  seen[from] = 1;
  while (!open.empty() && !seen[to]) {
    const int v = open.back();
    open.pop_back();
    for (const int e : tree_edges_of[v]) {
      const int w = edges[e].a == v ? edges[e].b : edges[e].a;
      if (seen[w]) continue;
      seen[w] = 1;
      via[w] = e;
      open.push_back(w);
    }
  }
  std::vector<int> path;
  for (int v = to; v != from;) {
    path.push_back(via[v]);
    v = edges[via[v]].a == v ? edges[via[v]].b : edges[via[v]].a;
  }
  std::reverse(path.begin(), path.end());
  return path;
}

Cycle CloseCycle(int closing, const std::vector<int>& path, const std::vector<CycleEdge>& edges,
                 const CycleConsistencyOptions& options) {
  const CycleEdge& closer = edges[closing];
  Cycle cycle;
  cycle.closing_edge = closing;
  cycle.edges = {closing};
  cycle.edges.insert(cycle.edges.end(), path.begin(), path.end());
  if (closer.probes_a.empty()) return cycle;

  // Walk from the closing edge's place in a along the tree to b, in units of the submap one is in.
  const Eigen::Vector3d start = Centroid(closer.probes_a);
  Eigen::Vector3d here = start, last_place = start;
  Similarity3 here_from_a;
  double distance = closer.viewing_distance_a, sigma = 0;
  cycle.allowed = options.per_edge * static_cast<double>(cycle.edges.size());
  int v = closer.a;
  for (const int e : path) {
    const CycleEdge& edge = edges[e];
    const bool forward = edge.a == v;
    const Similarity3 next_from_here = forward ? edge.b_from_a : edge.b_from_a.Inverse();
    if (!edge.probes_a.empty()) {
      const Eigen::Vector3d in_a = Centroid(edge.probes_a);
      const Eigen::Vector3d place = forward ? in_a : Eigen::Vector3d(edge.b_from_a * in_a);
      cycle.allowed += options.drift * (place - last_place).norm() / distance;
      last_place = next_from_here * place;
    }
    // In viewing distances, the same number on both sides of an edge.
    const Eigen::Vector3d x_a = forward ? here : Eigen::Vector3d(next_from_here * here);
    const double unit_b = forward ? distance * edge.b_from_a.scale : distance;
    sigma = std::hypot(sigma, PlacementSigma(edge, x_a) / unit_b);
    here = next_from_here * here;
    here_from_a = next_from_here * here_from_a;
    distance *= next_from_here.scale;
    v = forward ? edge.b : edge.a;
  }
  cycle.allowed += options.drift * (closer.b_from_a * start - last_place).norm() / (distance > 0 ? distance : 1);
  sigma = std::hypot(sigma, PlacementSigma(closer, start) / (closer.viewing_distance_a * closer.b_from_a.scale));
  cycle.allowed += options.num_sigmas * sigma;

  std::vector<double> displacements;
  const double unit = closer.viewing_distance_a * closer.b_from_a.scale;
  for (const Eigen::Vector3d& x : closer.probes_a) {
    displacements.push_back((here_from_a * x - closer.b_from_a * x).norm() / unit);
  }
  cycle.displacement = Median(displacements);
  cycle.consistent = cycle.displacement <= cycle.allowed;
  return cycle;
}

struct Judgement {
  SpanningForest forest;
  std::vector<Cycle> cycles;
};

// Maximum forest of the active edges, and the cycles that the others close.
Judgement Judge(int num_vertices, const std::vector<CycleEdge>& edges, const std::vector<char>& active,
                const CycleConsistencyOptions& options) {
  std::vector<WeightedEdge> weighted;
  std::vector<int> index;
  for (size_t i = 0; i < edges.size(); ++i) {
    if (!active[i]) continue;
    weighted.push_back({edges[i].a, edges[i].b, edges[i].strength});
    index.push_back(static_cast<int>(i));
  }
  Judgement judgement;
  judgement.forest = MaximumSpanningForest(num_vertices, weighted);
  std::vector<char> in_tree(edges.size(), 0);
  std::vector<std::vector<int>> tree_edges_of(num_vertices);
  for (int& e : judgement.forest.edges) {
    e = index[e];
    in_tree[e] = 1;
    tree_edges_of[edges[e].a].push_back(e);
    tree_edges_of[edges[e].b].push_back(e);
  }
  for (const int e : index) {
    if (in_tree[e]) continue;
    const std::vector<int> path = TreePath(tree_edges_of, edges, edges[e].a, edges[e].b);
    judgement.cycles.push_back(CloseCycle(e, path, edges, options));
  }
  return judgement;
}

}  // namespace

std::string CycleConsistencyOptions::Check() const { return CheckOptions(*this); }

CycleConsistencyResult FindConsistentForest(int num_vertices, const std::vector<CycleEdge>& edges,
                                            const CycleConsistencyOptions& options, const EdgeCredit& credit) {
  CycleConsistencyResult result;
  std::vector<double> credits(edges.size(), -1);  // below 0: not asked yet
  const auto worth = [&](int e) {
    if (credits[e] < 0) credits[e] = credit ? credit(e) : 1;
    return edges[e].strength * credits[e];
  };
  result.active.assign(edges.size(), 1);
  result.reason.resize(edges.size());
  for (;;) {
    Judgement now = Judge(num_vertices, edges, result.active, options);
    const Cycle* worst = nullptr;
    std::vector<char> confirmed(edges.size(), 0);
    for (const Cycle& cycle : now.cycles) {
      if (cycle.consistent) {
        for (const int e : cycle.edges) confirmed[e] = 1;
      } else if (!worst || cycle.displacement / cycle.allowed > worst->displacement / worst->allowed) {
        worst = &cycle;
      }
    }
    if (!worst) {
      result.forest = std::move(now.forest);
      result.cycles = std::move(now.cycles);
      return result;
    }
    std::vector<int> suspects;
    for (const int e : worst->edges) {
      if (!confirmed[e]) suspects.push_back(e);
    }
    if (suspects.empty()) suspects = worst->edges;
    int culprit = -1;
    double least_loss = std::numeric_limits<double>::infinity();
    for (const int e : suspects) {
      std::vector<char> without = result.active;
      without[e] = 0;
      double loss = worth(e);
      for (const Cycle& cycle : Judge(num_vertices, edges, without, options).cycles) {
        if (!cycle.consistent) loss += worth(cycle.closing_edge);
      }
      if (loss < least_loss) {
        least_loss = loss;
        culprit = e;
      }
    }
    result.active[culprit] = 0;
    char text[320];
    std::snprintf(text, sizeof(text),
                  "going round a cycle of %zu connections moves the common points by %.0f %% of the viewing distance "
                  "(%.0f %% allowed); leaving out this one (C = %.1f) costs least",
                  worst->edges.size(), 100 * worst->displacement, 100 * worst->allowed, edges[culprit].strength);
    result.reason[culprit] = text;
    if (credit) {
      std::snprintf(text, sizeof(text), "; %.0f %% of the keyframes that it lays over each other are connected",
                    100 * credits[culprit]);
      result.reason[culprit] += text;
    }
  }
}

}  // namespace mapmend

#pragma once

#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/similarity3.h"

namespace mapmend {

// How exactly a relation is known, one standard deviation each.
struct RelationSigmas {
  double rotation = 0.01;     // radians
  double translation = 0.02;  // of the depth of the scene at camera b (median)
  double scale = 0.02;        // of the natural logarithm

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("rotation", rotation, MoreThan(0), "radians");
    v("translation", translation, MoreThan(0), "of the median depth");
    v("scale", scale, MoreThan(0), "of its logarithm");
  }
};

// A measured relation between two vertices of a pose graph: b_from_a takes coordinates of camera a into those of camera
// b.
struct PoseGraphEdge {
  int a = -1, b = -1;
  Similarity3 b_from_a;
  double sigma_rotation = 0.01;     // radians
  double sigma_translation = 0.02;  // units of camera b
  double sigma_scale = 0.02;        // of the natural logarithm
  bool robust = false;              // Cauchy loss: for relations that may be wrong

  // depth: median depth of the scene at camera b, in its units.
  void SetSigmas(const RelationSigmas& sigmas, double depth) {
    sigma_rotation = sigmas.rotation;
    sigma_translation = sigmas.translation * depth;
    sigma_scale = sigmas.scale;
  }
};

struct PoseGraphOptions {
  int max_iterations = 50;
  double cauchy = 3;  // sigma at which a robust edge begins to lose influence

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_iterations", max_iterations, Range(1, 10000));
    v("cauchy", cauchy, MoreThan(0), "sigma");
  }
};

struct PositionPrior;

struct PoseGraphSummary {
  bool success = false;
  int num_iterations = 0;
  double initial_cost = 0, final_cost = 0;  // robust
};

// Improves root_from_vertex so that vertices agree with the edges: nonlinear least squares over rotations, translations
// and scales (after H. Strasdat, J. Montiel, A. Davison, RSS 2010). Vertex `fixed` stays; -1: none. Ceres, one thread:
// bit-reproducible.
//   positions  of vertices; null: none
PoseGraphSummary OptimizePoseGraph(const std::vector<PoseGraphEdge>& edges, int fixed, const PoseGraphOptions& options,
                                   std::vector<Similarity3>* root_from_vertex,
                                   const std::vector<PositionPrior>* positions = nullptr);

}  // namespace mapmend

#pragma once

#include <string>
#include <vector>

#include "libs/geometry/similarity3.h"

namespace mapmend {

// A measured relation between two vertices of a pose graph: b_from_a takes coordinates of camera a into those of camera
// b.
struct PoseGraphEdge {
  int a = -1, b = -1;
  Similarity3 b_from_a;
  double sigma_rotation = 0.01;     // radians
  double sigma_translation = 0.02;  // units of camera b
  double sigma_scale = 0.02;        // of the natural logarithm
  bool robust = false;              // Cauchy loss: for relations that may be wrong
};

struct PoseGraphOptions {
  int max_iterations = 50;
  double cauchy = 3;  // sigma at which a robust edge begins to lose influence
};

struct PoseGraphSummary {
  bool success = false;
  int num_iterations = 0;
  double initial_cost = 0, final_cost = 0;  // robust
};

// Improves root_from_vertex so that vertices agree with the edges: nonlinear least squares over rotations, translations
// and scales (after H. Strasdat, J. Montiel, A. Davison, RSS 2010). Vertex `fixed` stays. Ceres, one thread:
// bit-reproducible.
PoseGraphSummary OptimizePoseGraph(const std::vector<PoseGraphEdge>& edges, int fixed, const PoseGraphOptions& options,
                                   std::vector<Similarity3>* root_from_vertex);

}  // namespace mapmend

#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/kruskal.h"
#include "libs/geometry/sim3_refinement.h"

namespace mapmend {

// An edge as the consistency check sees it.
struct CycleEdge {
  int a = -1, b = -1;  // submaps, as vertices
  double strength = 0;
  Similarity3 b_from_a;
  Matrix7d information = Matrix7d::Zero();
  std::vector<Eigen::Vector3d> probes_a;  // a few of the common points, frame of a
  double viewing_distance_a = 1;          // units of a
};

struct CycleConsistencyOptions {
  // Tolerance of a cycle, in viewing distances: the common points of the edge that closes it may come back displaced by
  double per_edge = 0.05;  // for every edge of the cycle
  double drift = 0.05;     // for every viewing distance travelled within submaps from edge to edge
  double num_sigmas = 9;   // and by the edges' own uncertainty, 3 sigma, and 3 more for what the model leaves out

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("per_edge", per_edge, MoreThan(0), "viewing distances");
    v("drift", drift, AtLeast(0), "of the way");
    v("num_sigmas", num_sigmas, AtLeast(0), "sigma");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// What going round one cycle showed.
struct Cycle {
  int closing_edge = -1;
  std::vector<int> edges;   // all of it, the closing one first
  double displacement = 0;  // median, viewing distances
  double allowed = 0;
  bool consistent = true;
};

struct CycleConsistencyResult {
  SpanningForest forest;            // of the edges left
  std::vector<char> active;         // per edge
  std::vector<std::string> reason;  // per edge, why it was deactivated; empty if active
  std::vector<Cycle> cycles;        // of the final forest
};

// Which share of an edge's strength counts when it is judged, 0 to 1. Asked only of edges of inconsistent cycles, once
// each.
using EdgeCredit = std::function<double(int edge)>;

// Maximum spanning forest of the edges that survive the check: each edge off the tree closes a cycle; composing the
// transforms round it must bring the points back. Of an inconsistent cycle one edge is deactivated: the one whose loss
// costs least, in strength times credit, its own and that of all edges that then still close inconsistent cycles. With
// a single cycle that is its weakest edge; a strong wrong edge within the tree is found by the many that contradict it.
// Edges that a consistent cycle confirms are spared if any other is left. Then Kruskal runs again, until all cycles are
// consistent.
//   credit  none: 1 for all
CycleConsistencyResult FindConsistentForest(int num_vertices, const std::vector<CycleEdge>& edges,
                                            const CycleConsistencyOptions& options, const EdgeCredit& credit = {});

}  // namespace mapmend

#pragma once

#include <vector>

#include "libs/connecting/kruskal.h"
#include "libs/geometry/similarity3.h"

namespace mapmend {

struct MergedPlace {
  int root = -1;    // vertex; itself for a root
  int parent = -1;  // next vertex towards the root
  int depth = 0;    // edges to the root
  Similarity3 root_from_vertex;
};

// Where an earlier refinement put a vertex relative to the others that it refined together.
struct RefinedPlace {
  int group = -1;  // -1: it was not refined
  Similarity3 group_from_vertex;
};

// Places every vertex in the frame of its component's root by composing transforms along a forest. The root of a
// component is its lowest vertex: vertices are numbered oldest first, so transforms published before stay put when a
// submap joins.
//   refined  empty, or per vertex: vertices of one group and one component keep their places relative to each other,
//   whatever
//            the edges between them say; only the first of a group that the walk from the root reaches is placed by an
//            edge
std::vector<MergedPlace> ComposeAlongForest(int num_vertices, const std::vector<TreeEdge>& forest,
                                            const std::vector<RefinedPlace>& refined = {});

}  // namespace mapmend

#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/local_window.h"
#include "libs/optim/sim3_pose_graph.h"

// The relations of a Sim(3) pose graph over keyframes.
namespace mapmend {

// Which keyframes are related, and how exactly. The ratios of the sigmas decide where the map bends.
struct KeyframeRelationOptions {
  // As tracked: each keyframe with the next ones and with the most covisible ones.
  int num_next = 2;
  int max_covisible = 5;
  int min_shared = 30;  // points of a covisible one
  // Neighbours see hundreds of points in common from nearly the same place; tracking drifts over many of them.
  RelationSigmas tracked = {0.003, 0.005, 0.005};
  // A loop or a connection: fewer points, of two maps, each with a noise of its own: twice as uncertain.
  RelationSigmas verified = {0.005, 0.01, 0.01};

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("num_next", num_next, Range(1, 1000), "keyframes");
    v("max_covisible", max_covisible, Range(0, 1000), "keyframes");
    v("min_shared", min_shared, Range(1, 100000), "points");
    v("tracked", tracked);
    v("verified", verified);
  }
};

// As tracked, within one submap. Its keyframes are the vertices first_vertex, first_vertex + 1, ... by ascending id.
void AddTrackedRelations(const Submap& submap, int first_vertex, const KeyframeRelationOptions& options,
                         std::vector<PoseGraphEdge>* edges);

// As verified: b_from_a between the submap frames, which are the same for a loop, seen in these two keyframes.
PoseGraphEdge VerifiedRelation(const Submap& submap_a, KeyframeId keyframe_a, int vertex_a, const Submap& submap_b,
                               KeyframeId keyframe_b, int vertex_b, const Similarity3& b_from_a,
                               const RelationSigmas& sigmas);

}  // namespace mapmend

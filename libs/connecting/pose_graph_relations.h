#pragma once

#include <vector>

#include "libs/connecting/local_window.h"
#include "libs/optim/sim3_pose_graph.h"

// The relations of a Sim(3) pose graph over keyframes.
namespace mapmend {

// As tracked, within one submap: each keyframe with the next two and with the five most covisible ones. Its keyframes
// are the vertices first_vertex, first_vertex + 1, ... by ascending id.
void AddTrackedRelations(const Submap& submap, int first_vertex, std::vector<PoseGraphEdge>* edges);

// As verified: b_from_a between the submap frames, which are the same for a loop, seen in these two keyframes.
PoseGraphEdge VerifiedRelation(const Submap& submap_a, KeyframeId keyframe_a, int vertex_a, const Submap& submap_b,
                               KeyframeId keyframe_b, int vertex_b, const Similarity3& b_from_a);

}  // namespace mapmend

#include "libs/connecting/pose_graph_relations.h"

#include <algorithm>
#include <iterator>
#include <set>

namespace mapmend {

void AddTrackedRelations(const Submap& submap, int first_vertex, const KeyframeRelationOptions& options,
                         std::vector<PoseGraphEdge>* edges) {
  std::map<KeyframeId, int> vertex;
  for (const auto& [id, keyframe] : submap.keyframes)
    vertex.emplace(id, first_vertex + static_cast<int>(vertex.size()));
  for (auto it = submap.keyframes.begin(); it != submap.keyframes.end(); ++it) {
    const SubmapKeyframe& a = it->second;
    std::set<KeyframeId> others;
    auto next = std::next(it);
    for (int i = 0; i < options.num_next && next != submap.keyframes.end(); ++i, ++next) others.insert(next->first);
    int taken = 0;
    for (const CovisibleKeyframe& c : FindCovisible(submap, a, options.min_shared)) {
      if (taken++ >= options.max_covisible) break;
      if (c.keyframe->id > a.id) others.insert(c.keyframe->id);
    }
    for (const KeyframeId other : others) {
      const SubmapKeyframe& b = submap.keyframes.at(other);
      const double depth = std::max(1e-9, MedianDepth(submap, b));
      PoseGraphEdge edge;
      edge.a = vertex.at(a.id);
      edge.b = vertex.at(other);
      edge.b_from_a = Similarity3(b.cam_from_submap * a.cam_from_submap.Inverse());
      edge.SetSigmas(options.tracked, depth);
      edges->push_back(edge);
    }
  }
}

PoseGraphEdge VerifiedRelation(const Submap& submap_a, KeyframeId keyframe_a, int vertex_a, const Submap& submap_b,
                               KeyframeId keyframe_b, int vertex_b, const Similarity3& b_from_a,
                               const RelationSigmas& sigmas) {
  const SubmapKeyframe &a = submap_a.keyframes.at(keyframe_a), &b = submap_b.keyframes.at(keyframe_b);
  PoseGraphEdge edge;
  edge.a = vertex_a;
  edge.b = vertex_b;
  edge.b_from_a = Similarity3(b.cam_from_submap) * b_from_a * Similarity3(a.cam_from_submap.Inverse());
  edge.SetSigmas(sigmas, std::max(1e-9, MedianDepth(submap_b, b)));
  edge.robust = true;
  return edge;
}

}  // namespace mapmend

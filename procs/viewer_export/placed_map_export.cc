#include "procs/viewer_export/placed_map_export.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "libs/connecting/motion_bridge.h"
#include "libs/connecting/pose_graph_relations.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/submap_color.h"

namespace mapmend {
namespace {

using Pair = EvaluatedConnection::FramePair;

// Lists relations between the keyframes of a component.
class RelationLister {
 public:
  RelationLister(const Snapshot& snapshot, int component, std::vector<PlacedRelation>* relations)
      : snapshot_(snapshot), component_(snapshot.components[component]), relations_(relations) {
    for (size_t i = 0; i < component_.keyframes.size(); ++i) {
      const SnapshotKeyframe& keyframe = component_.keyframes[i];
      index_[{keyframe.submap, keyframe.id}] = static_cast<int>(i);
    }
  }

  void AddTracked() {
    for (const int s : component_.submaps) {
      const Submap& submap = *snapshot_.submaps[s].submap;
      std::vector<int> vertices;
      for (const auto& [id, keyframe] : submap.keyframes) vertices.push_back(index_.at({s, id}));
      std::vector<PoseGraphEdge> edges;
      AddTrackedRelations(submap, 0, options_, &edges);
      for (PoseGraphEdge& edge : edges) {
        edge.a = vertices[edge.a];
        edge.b = vertices[edge.b];
        Add(PlacedRelation::Kind::kTracked, edge);
      }
    }
  }

  void AddConnection(const GraphEdge& edge) {
    const EvaluatedConnection& c = *edge.connection;
    const int a = snapshot_.FindSubmap(c.a), b = snapshot_.FindSubmap(c.b);
    for (const Pair& pair : c.pairs) AddPair(PlacedRelation::Kind::kConnection, c, a, b, pair);
  }

  // Of the pairs of a loop closure each has a transform of its own; only the strongest one's is told.
  void AddLoop(const GraphEdge& edge) {
    const EvaluatedConnection& c = *edge.connection;
    const auto strongest = std::max_element(c.pairs.begin(), c.pairs.end(),
                                            [](const Pair& l, const Pair& r) { return l.num_inliers < r.num_inliers; });
    if (strongest != c.pairs.end()) AddPair(PlacedRelation::Kind::kLoop, c, edge.a, edge.a, *strongest);
  }

 private:
  void AddPair(PlacedRelation::Kind kind, const EvaluatedConnection& c, int a, int b, const Pair& pair) {
    const auto from = index_.find({a, pair.a}), to = index_.find({b, pair.b});
    if (from == index_.end() || to == index_.end() || from == to) return;  // culled since, or of another component
    if (c.in_tree) kind = PlacedRelation::Kind::kTree;
    // What the camera's motion leaves open is not told one by one, but at most so much.
    const RelationSigmas sigmas =
        KindOf(c) == ConnectionKind::kMotion ? MotionBridgeOptions().max_open : options_.verified;
    Add(kind, VerifiedRelation(*snapshot_.submaps[a].submap, pair.a, from->second, *snapshot_.submaps[b].submap, pair.b,
                               to->second, c.b_from_a, sigmas));
  }

  // From the units of the submaps into that of the map.
  void Add(PlacedRelation::Kind kind, const PoseGraphEdge& edge) {
    const Similarity3 a_from_b = edge.b_from_a.Inverse();
    PlacedRelation relation;
    relation.kind = kind;
    relation.a = edge.a;
    relation.b = edge.b;
    relation.a_from_b = Rigid3(a_from_b.rotation, component_.keyframes[edge.a].scale * a_from_b.translation);
    relation.sigma_rotation = edge.sigma_rotation;
    relation.sigma_translation = component_.keyframes[edge.b].scale * edge.sigma_translation;
    relations_->push_back(relation);
  }

  const Snapshot& snapshot_;
  const SnapshotComponent& component_;
  const KeyframeRelationOptions options_;
  std::map<std::pair<int, KeyframeId>, int> index_;
  std::vector<PlacedRelation>* relations_;
};

std::vector<PlacedRelation> Relations(const Snapshot& snapshot, int component) {
  std::vector<PlacedRelation> relations;
  RelationLister lister(snapshot, component, &relations);
  lister.AddTracked();
  const auto is_used = [](const GraphEdge& edge) {
    return edge.connection->verdict == EvaluatedConnection::Verdict::kAccepted;
  };
  for (const GraphEdge& edge : ListEdges(snapshot)) {
    if (is_used(edge) && snapshot.submaps[edge.a].component == component) lister.AddConnection(edge);
  }
  for (const GraphEdge& edge : ListLoops(snapshot)) {
    if (is_used(edge) && snapshot.submaps[edge.a].component == component) lister.AddLoop(edge);
  }
  return relations;
}

void AddFrames(const Snapshot& snapshot, const SnapshotComponent& component, PlacedMap* map) {
  std::map<std::pair<int, int>, int> submap_of;  // the last submap that holds a session's frame
  for (const int s : component.submaps) {
    for (const MergedFrame& frame : snapshot.submaps[s].frames) submap_of[{frame.session, frame.frame}] = s;
  }
  for (const MergedFrame& frame : component.frames) {
    map->frames.push_back({frame.utime, frame.session, submap_of.at({frame.session, frame.frame}), frame.frame,
                           frame.cam_from_root.Inverse()});
  }
  for (const SnapshotKeyframe& placed : component.keyframes) {
    const SnapshotSubmap& submap = snapshot.submaps[placed.submap];
    map->keyframes.push_back({placed.utime, submap.session, placed.submap, submap.submap->keyframes.at(placed.id).frame,
                              placed.cam_from_root.Inverse()});
  }
}

void AddPoints(const Snapshot& snapshot, int component, PlacedMap* map) {
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) {
    std::set<KeyframeId> seen_from;
    for (const SubmapObservation& o : snapshot.submaps[point.submap].submap->points.at(point.id).observations)
      seen_from.insert(o.keyframe);
    map->points.push_back({point.position, point.color, point.submap, static_cast<int>(seen_from.size())});
  }
}

std::vector<PlacedLoss> Losses(const Snapshot& snapshot, const SnapshotComponent& component) {
  std::vector<PlacedLoss> losses;
  for (const int s : component.submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[s];
    if (!submap.Lost() || submap.frames.empty()) continue;
    losses.push_back({submap.frames.back().utime, SubmapName(submap) + ": tracking lost after frame " +
                                                      std::to_string(submap.submap->last_frame) + ", " +
                                                      ReadableReason(submap.submap->end_reason)});
  }
  std::stable_sort(losses.begin(), losses.end(),
                   [](const PlacedLoss& l, const PlacedLoss& r) { return l.utime < r.utime; });
  return losses;
}

}  // namespace

PlacedMap MakePlacedMap(const Snapshot& snapshot, int component_index) {
  const SnapshotComponent& component = snapshot.components[component_index];
  PlacedMap map;
  map.title = component_index == 0 ? "main map" : "part " + std::to_string(component_index);
  map.frame = component.frame;
  for (const std::string& session : snapshot.model->SessionOrder())
    map.cameras.push_back(snapshot.model->GetSession(session).info.pinhole);
  for (const SnapshotSubmap& submap : snapshot.submaps)
    map.submaps.push_back({submap.number, SubmapColor(submap.number)});
  AddFrames(snapshot, component, &map);
  AddPoints(snapshot, component_index, &map);
  map.relations = Relations(snapshot, component_index);
  map.losses = Losses(snapshot, component);
  return map;
}

}  // namespace mapmend

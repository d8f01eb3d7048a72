#include "libs/connecting/motion_bridge.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

#include "libs/base/text_format.h"
#include "libs/connecting/merged_transforms.h"
#include "libs/geometry/gap_in_path.h"
#include "libs/geometry/sim3_refinement.h"
#include "libs/optim/sim3_pose_graph.h"

namespace mapmend {
namespace {

// A tracked frame, and where its keyframe lies.
struct TracedFrame {
  int64_t utime = 0;
  SubmapKey submap;
  size_t vertex = 0;  // of the submap
  KeyframeId keyframe;
  Rigid3 cam_from_submap;
};

// Frames that follow each other in time and lie in one component.
struct Stretch {
  int component = -1;
  std::vector<TracedFrame> frames;
  std::vector<PathPose> path;  // in the frame of the component
};

// Per vertex of the graph.
struct Places {
  std::vector<int> component;
  std::vector<Similarity3> root_from_submap;
};

Places FindPlaces(const ConnectionGraph& graph) {
  Places found;
  found.component = graph.forest().component;
  for (const MergedPlace& place : ComposeAlongForest(static_cast<int>(found.component.size()), graph.tree()))
    found.root_from_submap.push_back(place.root_from_vertex);
  return found;
}

// Of one flight, in the order of time.
std::vector<Stretch> FindStretches(const Session& session, const std::vector<SubmapKey>& vertices,
                                   const Places& places) {
  std::vector<TracedFrame> frames;
  for (size_t vertex = 0; vertex < vertices.size(); ++vertex) {
    if (vertices[vertex].session != session.id) continue;
    const Submap& submap = session.submaps.at(vertices[vertex].submap);
    if (!submap.ended) return {};
    for (const TrackedFrame& frame : submap.frames) {
      const TrackedFrame resolved = submap.Resolved(frame);
      frames.push_back({frame.utime, vertices[vertex], vertex, resolved.keyframe, submap.CamFromSubmap(frame)});
    }
  }
  std::stable_sort(frames.begin(), frames.end(),
                   [](const TracedFrame& l, const TracedFrame& r) { return l.utime < r.utime; });
  std::vector<Stretch> stretches;
  for (TracedFrame& frame : frames) {
    const int component = places.component[frame.vertex];
    if (stretches.empty() || stretches.back().component != component) stretches.push_back({component, {}, {}});
    Stretch& stretch = stretches.back();
    const double seconds = 1e-6 * static_cast<double>(frame.utime - session.start_utime);
    if (!stretch.path.empty() && seconds <= stretch.path.back().seconds) continue;
    const Similarity3 root_from_cam =
        places.root_from_submap[frame.vertex] * Similarity3(frame.cam_from_submap.Inverse());
    stretch.path.push_back({seconds, Rigid3(root_from_cam.rotation, root_from_cam.translation)});
    stretch.frames.push_back(std::move(frame));
  }
  return stretches;
}

// The camera's depth, in the unit of its component.
double DepthAt(const Sessions& sessions, const Places& places, const TracedFrame& frame) {
  const Submap& submap = *ViewSubmap(sessions, frame.submap).submap;
  const auto keyframe = submap.keyframes.find(frame.keyframe);
  const double depth = keyframe == submap.keyframes.end() ? 0 : MedianDepth(submap, keyframe->second);
  return depth * places.root_from_submap[frame.vertex].scale;
}

double WayAlong(const std::vector<PathPose>& path) {
  double way = 0;
  for (size_t i = 1; i < path.size(); ++i)
    way += (path[i].world_from_cam.translation - path[i - 1].world_from_cam.translation).norm();
  return way;
}

// The four cameras around the two gaps, as vertices: the last one before the part, its first and its last one, the
// first one behind it.
enum Vertex { kBefore = 0, kFirst = 1, kLast = 2, kAfter = 3 };

// From the camera behind a gap to the one before it. A guess that has never been wrong still is one.
PoseGraphEdge GapEdge(int before, int behind, const BridgedGap& gap, double depth) {
  constexpr RelationSigmas kLeast = {0.002, 0.002, 0.5};
  // Tracking is lost where the camera moves unevenly, and quiet pieces of its path do not show that.
  constexpr double kUneven = 0.25;
  PoseGraphEdge edge;
  edge.a = behind;
  edge.b = before;
  edge.b_from_a = Similarity3(gap.before_from_after) *
                  Similarity3(gap.scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  edge.sigma_rotation = std::max(
      {kLeast.rotation, gap.sigma_angle / std::sqrt(3.0), kUneven * RotationAngle(gap.before_from_after.rotation)});
  edge.sigma_translation = std::max({kLeast.translation * depth, gap.sigma_position / std::sqrt(3.0),
                                     kUneven * gap.before_from_after.translation.norm()});
  // Equal speed on both sides is a first guess, which a gust changes: the length between the two gaps tells the scale.
  edge.sigma_scale = std::max(kLeast.scale, gap.sigma_scale);
  return edge;
}

// Between two cameras of one component.
PoseGraphEdge ShapeEdge(int from, const PathPose& from_pose, int to, const PathPose& to_pose, double way, double depth,
                        const RelationSigmas& shape) {
  PoseGraphEdge edge;
  edge.a = from;
  edge.b = to;
  edge.b_from_a = Similarity3(to_pose.world_from_cam.Inverse() * from_pose.world_from_cam);
  const double growth = std::sqrt(1 + way / depth);
  edge.SetSigmas({growth * shape.rotation, growth * shape.translation, growth * shape.scale}, depth);
  return edge;
}

// What is known of a relation between two submaps at a camera: sigmas.translation in the unit of b.
Matrix7d InformationAt(const Similarity3& b_from_a, const Eigen::Vector3d& camera_in_a, const RelationSigmas& sigmas) {
  const Eigen::Matrix<double, 3, 7> place = PlaceJacobian(b_from_a, camera_in_a);
  Matrix7d information = place.transpose() * place / std::pow(sigmas.translation, 2);
  information.topLeftCorner<3, 3>() += Eigen::Matrix3d::Identity() / std::pow(sigmas.rotation, 2);
  information(6, 6) += 1 / std::pow(sigmas.scale, 2);
  return information;
}

// The pairs of submaps at the gap before a part, and at the one behind it.
using Gaps = std::pair<SubmapPair, SubmapPair>;

// Of what several say independently, one sigma each.
double Together(std::initializer_list<double> sigmas) {
  double information = 0;
  for (const double sigma : sigmas) information += 1 / (sigma * sigma);
  return 1 / std::sqrt(information);
}

class Bridge {
 public:
  Bridge(const Sessions& sessions, const Places& places, const MotionBridgeOptions& options)
      : sessions_(sessions), places_(places), options_(options) {}

  // Whether the part's place between two stretches of one component is known.
  bool Find(const Stretch& before, const Stretch& part, const Stretch& behind);
  Gaps Pairs(const Stretch& before, const Stretch& part, const Stretch& behind) const {
    return {MakePair(sessions_, before.frames.back().submap, part.frames.front().submap),
            MakePair(sessions_, part.frames.back().submap, behind.frames.front().submap)};
  }
  void AddTo(const Stretch& before, const Stretch& part, const Stretch& behind, ConnectionGraph* graph) const;

 private:
  void Add(const TracedFrame& outside, Vertex at_outside, const TracedFrame& inside, Vertex at_inside,
           ConnectionGraph* graph) const;
  // length: between the part's first and its last camera, in the part's unit.
  void FindUncertainty(double length);

  const Sessions& sessions_;
  const Places& places_;
  const MotionBridgeOptions& options_;
  BridgedGap first_, second_;
  std::vector<PoseGraphEdge> edges_;  // the gap before, the gap behind, the part's shape, that of what surrounds it
  std::vector<Similarity3> root_from_vertex_;
  double disagreement_ = 0;  // sum of squares
  double depth_ = 0;         // of the scene before the part
  RelationSigmas open_;      // of either end of the part; the translation in parts of that depth
};

void Bridge::FindUncertainty(double length) {
  const double scale = root_from_vertex_[kFirst].scale;
  const PoseGraphEdge &before = edges_[0], &behind = edges_[1], &of_part = edges_[2], &around = edges_[3];
  const double place_before = before.sigma_translation, place_behind = scale * behind.sigma_translation;
  const double way = scale * length;
  open_.scale = std::hypot(place_before, place_behind) / std::max(1e-12, way);
  const double shape_angle = std::hypot(of_part.sigma_rotation, around.sigma_rotation);
  open_.rotation = std::max(Together({before.sigma_rotation, std::hypot(behind.sigma_rotation, shape_angle)}),
                            Together({behind.sigma_rotation, std::hypot(before.sigma_rotation, shape_angle)}));
  // What a gap says of the part's other end is as good as the part's shape, direction and scale.
  const auto at_other_end = [&](double place, const PoseGraphEdge& gap) {
    const double shape = std::hypot(scale * of_part.sigma_translation, around.sigma_translation);
    return std::hypot(place, shape, way * std::hypot(gap.sigma_rotation, gap.sigma_scale));
  };
  open_.translation = std::max(Together({place_before, at_other_end(place_behind, behind)}),
                               Together({place_behind, at_other_end(place_before, before)}));
}

bool Bridge::Find(const Stretch& before, const Stretch& part, const Stretch& behind) {
  first_ = BridgeGap(before.path, part.path);
  second_ = BridgeGap(part.path, behind.path);
  if (!first_.success || !second_.success || std::max(first_.seconds, second_.seconds) > options_.max_gap_s)
    return false;
  depth_ = DepthAt(sessions_, places_, before.frames.back());
  const double depth_last = DepthAt(sessions_, places_, part.frames.back()),
               depth_behind = DepthAt(sessions_, places_, behind.frames.front());
  if (!(depth_ > 0) || !(depth_last > 0) || !(depth_behind > 0)) return false;
  const double way = WayAlong(part.path);
  edges_ = {GapEdge(kBefore, kFirst, first_, depth_), GapEdge(kLast, kAfter, second_, depth_last),
            ShapeEdge(kFirst, part.path.front(), kLast, part.path.back(), way, depth_last, options_.shape),
            ShapeEdge(kBefore, before.path.back(), kAfter, behind.path.front(), way * first_.scale, depth_behind,
                      options_.shape)};
  const Similarity3 root_from_first = Similarity3(before.path.back().world_from_cam) * edges_[0].b_from_a;
  root_from_vertex_ = {Similarity3(before.path.back().world_from_cam), root_from_first,
                       root_from_first * edges_[2].b_from_a.Inverse(), Similarity3(behind.path.front().world_from_cam)};
  const PoseGraphSummary solved = OptimizePoseGraph(edges_, kBefore, {}, &root_from_vertex_);
  disagreement_ = 2 * solved.final_cost;
  FindUncertainty((part.path.back().world_from_cam.translation - part.path.front().world_from_cam.translation).norm());
  open_.translation /= depth_;
  return solved.success && disagreement_ <= options_.max_squared_disagreement &&
         open_.translation <= options_.max_open.translation && open_.rotation <= options_.max_open.rotation &&
         open_.scale <= options_.max_open.scale;
}

void Bridge::Add(const TracedFrame& outside, Vertex at_outside, const TracedFrame& inside, Vertex at_inside,
                 ConnectionGraph* graph) const {
  // Cameras are as large as their components: the submaps' own scales go in beside.
  const auto submap_from_cam = [&](const TracedFrame& frame) {
    const double scale = places_.root_from_submap[frame.vertex].scale;
    return Similarity3(frame.cam_from_submap.Inverse()) *
           Similarity3(1 / scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  };
  const Similarity3 outside_from_inside = submap_from_cam(outside) * root_from_vertex_[at_outside].Inverse() *
                                          root_from_vertex_[at_inside] * submap_from_cam(inside).Inverse();
  const SubmapPair pair = MakePair(sessions_, outside.submap, inside.submap);
  const bool outside_is_older = pair.older == outside.submap;
  const TracedFrame &a = outside_is_older ? outside : inside, &b = outside_is_older ? inside : outside;
  ConnectedFrames frames;
  frames.success = frames.by_motion = true;
  frames.keyframe_a = a.keyframe;
  frames.keyframe_b = b.keyframe;
  frames.b_from_a = outside_is_older ? outside_from_inside.Inverse() : outside_from_inside;
  RelationSigmas sigmas = open_;
  sigmas.translation *= depth_ / places_.root_from_submap[outside.vertex].scale;
  if (outside_is_older) sigmas.translation *= frames.b_from_a.scale;
  frames.information = InformationAt(frames.b_from_a, a.cam_from_submap.Center(), sigmas);
  frames.reason = Format(
      "the camera went on as before and behind, across %.1f s and %.1f s; both sides agree (%.1f sigma), and leave the "
      "place open by %.1f %% of the viewing distance",
      first_.seconds, second_.seconds, std::sqrt(disagreement_ / 7), 100 * open_.translation);
  graph->Add(pair, std::move(frames));
}

void Bridge::AddTo(const Stretch& before, const Stretch& part, const Stretch& behind, ConnectionGraph* graph) const {
  Add(before.frames.back(), kBefore, part.frames.front(), kFirst, graph);
  Add(behind.frames.front(), kAfter, part.frames.back(), kLast, graph);
}

// What a person or a cycle has ruled out is not tried again.
bool IsRuledOut(const ConnectionGraph& graph, const SubmapPair& pair) {
  const auto known = graph.connections().find(pair);
  return known != graph.connections().end() && known->second.verdict == Connection::Verdict::kDeactivated;
}

// Joins the next part that holds, at the two gaps around it; none if there is none. tried: what was added to the graph.
std::optional<Gaps> BridgeNext(const Sessions& sessions, const MotionBridgeOptions& options,
                               const std::set<Gaps>& tried, ConnectionGraph* graph) {
  const Places places = FindPlaces(*graph);
  const std::vector<SubmapKey> vertices = SubmapsByAge(sessions);
  for (const auto& [id, session] : sessions) {
    const std::vector<Stretch> stretches = FindStretches(session, vertices, places);
    for (size_t i = 1; i + 1 < stretches.size(); ++i) {
      const Stretch &before = stretches[i - 1], &part = stretches[i], &behind = stretches[i + 1];
      if (before.component != behind.component) continue;
      Bridge bridge(sessions, places, options);
      const Gaps gaps = bridge.Pairs(before, part, behind);
      if (tried.contains(gaps) || IsRuledOut(*graph, gaps.first) || IsRuledOut(*graph, gaps.second)) continue;
      if (!bridge.Find(before, part, behind)) continue;
      bridge.AddTo(before, part, behind, graph);
      graph->Solve(sessions, {gaps.first, gaps.second}, false);
      return gaps;
    }
  }
  return std::nullopt;
}

}  // namespace

std::set<SubmapPair> BridgeByMotion(const Sessions& sessions, const MotionBridgeOptions& options,
                                    ConnectionGraph* graph) {
  std::set<Gaps> tried;
  std::set<SubmapPair> looked_at;
  if (options.max_gap_s <= 0 || SubmapsByAge(sessions).size() < 3) return looked_at;
  graph->Solve(sessions, {}, false);
  // Each one joins two components, after which others have something to be joined to.
  while (graph->forest().num_components > 1) {
    const std::optional<Gaps> gaps = BridgeNext(sessions, options, tried, graph);
    if (!gaps) break;
    tried.insert(*gaps);
    looked_at.insert({gaps->first, gaps->second});
  }
  return looked_at;
}

}  // namespace mapmend

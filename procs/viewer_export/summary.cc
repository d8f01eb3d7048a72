#include "procs/viewer_export/summary.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "libs/base/degree.h"
#include "libs/map_view/dead_reckoning.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/holes.h"
#include "procs/viewer_export/restoration.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

void AddErrors(const Evaluation& evaluation, OrderedJson* json) {
  if (!evaluation.success) return;
  (*json)["ate_rmse_m"] = evaluation.rmse;
  (*json)["ate_median_m"] = evaluation.median;
  (*json)["ate_max_m"] = evaluation.max;
}

void AddDepthShare(const SnapshotSubmap& submap, const DepthShare& share, OrderedJson* json) {
  if (share.median_depth <= 0) return;
  (*json)["scene_depth_m"] = share.median_depth;
  (*json)["max_error_of_depth"] = share.largest;
  for (const auto& frame : submap.frames) {
    if (frame.utime == share.utime) (*json)["max_error_of_depth_frame"] = frame.frame;
  }
}

OrderedJson Sessions(const Snapshot& snapshot) {
  OrderedJson sessions = OrderedJson::array();
  std::map<int, int> in_main;  // frames, by session
  if (!snapshot.components.empty()) {
    for (const MergedFrame& frame : snapshot.components[0].frames) ++in_main[frame.session];
  }
  for (size_t i = 0; i < snapshot.model->SessionOrder().size(); ++i) {
    const std::string& id = snapshot.model->SessionOrder()[i];
    const Session& session = snapshot.model->GetSession(id);
    std::set<int> tracked;
    for (const SnapshotSubmap& submap : snapshot.submaps) {
      if (submap.session != static_cast<int>(i)) continue;
      for (const MergedFrame& frame : submap.frames) tracked.insert(frame.frame);
    }
    sessions.push_back({{"id", id},
                        {"vehicle", session.info.vehicle},
                        {"source", session.info.source},
                        {"start_utime", session.start_utime},
                        {"frames_in", session.num_frames},
                        {"frames_tracked", tracked.size()},
                        {"frames_in_main", in_main[static_cast<int>(i)]},
                        {"ended", session.ended}});
  }
  return sessions;
}

OrderedJson Holes(const std::vector<MapHole>& holes) {
  OrderedJson list = OrderedJson::array();
  for (const MapHole& hole : holes) {
    list.push_back({{"session", hole.session},
                    {"first_frame", hole.first_frame},
                    {"last_frame", hole.last_frame},
                    {"seconds", 1e-6 * static_cast<double>(hole.duration_us)}});
  }
  return list;
}

OrderedJson Submaps(const Snapshot& snapshot, const MapEvaluation* evaluation) {
  OrderedJson submaps = OrderedJson::array();
  for (size_t i = 0; i < snapshot.submaps.size(); ++i) {
    const SnapshotSubmap& s = snapshot.submaps[i];
    OrderedJson json = {{"id", s.number},
                        {"letters", SubmapLetters(static_cast<int>(i))},
                        {"session", s.session},
                        {"session_submap", s.key.submap.value},
                        {"frames", s.frames.size()},
                        {"keyframes", s.submap->keyframes.size()},
                        {"points", s.submap->points.size()},
                        {"component", s.component},
                        {"is_root", s.is_root},
                        {"first_frame", s.frames.empty() ? -1 : s.frames.front().frame},
                        {"last_frame", s.frames.empty() ? -1 : s.frames.back().frame},
                        {"end_reason", s.submap->end_reason},
                        {"end_detail", s.submap->end_detail},
                        {"root_from_submap", ToArray(s.root_from_submap)}};
    if (evaluation != nullptr) {
      AddErrors(evaluation->submaps[i], &json);
      AddDepthShare(s, evaluation->depth_shares[i], &json);
    }
    submaps.push_back(json);
  }
  return submaps;
}

OrderedJson Components(const Snapshot& snapshot, const MapEvaluation* evaluation,
                       const std::vector<size_t>& num_points) {
  OrderedJson components = OrderedJson::array();
  for (size_t c = 0; c < snapshot.components.size(); ++c) {
    const SnapshotComponent& component = snapshot.components[c];
    OrderedJson numbers = OrderedJson::array();
    for (const int index : component.submaps) numbers.push_back(snapshot.submaps[index].number);
    OrderedJson json = {{"root", snapshot.submaps[component.root].number},
                        {"submaps", numbers},
                        {"frames", component.frames.size()},
                        {"keyframes", component.keyframes.size()},
                        {"points", num_points[c]}};
    if (evaluation != nullptr) AddErrors(evaluation->components[c], &json);
    components.push_back(json);
  }
  return components;
}

OrderedJson Connections(const Snapshot& snapshot, const std::vector<GraphEdge>& edges) {
  OrderedJson connections = OrderedJson::array();
  for (const GraphEdge& edge : edges) {
    const EvaluatedConnection& c = *edge.connection;
    // Listed from the lower number to the higher one, whichever way round it was evaluated.
    const bool swapped = snapshot.FindSubmap(c.a) != edge.a;
    connections.push_back({{"a", snapshot.submaps[edge.a].number},
                           {"b", snapshot.submaps[edge.b].number},
                           {"F", c.num_connected_frames},
                           {"M", c.num_common_points},
                           {"theta_deg", c.median_angle_deg},
                           {"C", c.strength},
                           {"scale", swapped ? 1 / c.b_from_a.scale : c.b_from_a.scale},
                           {"inliers", c.num_inliers},
                           {"candidates", c.num_candidates},
                           {"reprojection_error_px", c.median_error_px},
                           {"verdict", ToString(c.verdict)},
                           {"kind", ToString(KindOf(c))},
                           {"weak", IsWeak(c)},
                           {"reason", c.reason},
                           {"in_tree", c.in_tree}});
  }
  return connections;
}

OrderedJson LikelyPlaces(const Snapshot& snapshot) {
  OrderedJson places = OrderedJson::array();
  for (const LikelyPlace& place : FindLikelyPlaces(snapshot)) {
    const SnapshotSubmap& earlier = snapshot.submaps[place.earlier];
    const BridgedGap& gap = place.gap;
    places.push_back({{"kind", "dead_reckoning"},
                      {"a", earlier.number},
                      {"b", snapshot.submaps[place.later].number},
                      {"last_frame", place.last_frame},
                      {"first_frame", place.first_frame},
                      {"seconds", gap.seconds},
                      {"unit", snapshot.components[earlier.component].frame.unit},
                      {"distance", gap.before_from_after.translation.norm()},
                      {"distance_sigma", gap.sigma_position},
                      {"turn_deg", RotationAngle(gap.before_from_after.rotation) / kDegree},
                      {"turn_sigma_deg", gap.sigma_angle / kDegree},
                      {"scale", gap.scale},
                      {"scale_sigma", gap.sigma_scale},
                      {"a_from_b", ToArray(place.earlier_from_later)},
                      {"text", DescribeLikelyPlace(place, snapshot)}});
  }
  return places;
}

OrderedJson Stack(const Snapshot& snapshot, const std::vector<std::vector<int>>& maps) {
  OrderedJson stack = OrderedJson::array();
  for (const std::vector<int>& map : maps) {
    OrderedJson numbers = OrderedJson::array();
    for (const int submap : map) numbers.push_back(snapshot.submaps[submap].number);
    stack.push_back(numbers);
  }
  return stack;
}

OrderedJson Restorations(const Snapshot& snapshot) {
  const RestorationTable table = MakeRestorationTable(snapshot);
  OrderedJson steps = OrderedJson::array();
  for (const RestorationStep& step : table.steps) {
    const bool merges = step.event == RestorationStep::Event::kMerge;
    OrderedJson json = {{"event", merges ? "merge" : "new_map"},
                        {"utime", step.utime},
                        {"frame", step.frame},
                        {"submap", snapshot.submaps[step.submap].number}};
    if (step.lost >= 0) {
      json["lost"] = snapshot.submaps[step.lost].number;
      json["loss_reason"] = snapshot.submaps[step.lost].submap->end_reason;
    }
    if (merges) {
      std::vector<GraphEdge> edges;
      for (const int index : step.connections) {
        const EvaluatedConnection* connection = table.connections[index];
        edges.push_back({snapshot.FindSubmap(connection->a), snapshot.FindSubmap(connection->b), connection});
      }
      json["connections"] = Connections(snapshot, edges);
    }
    json["L1"] = Stack(snapshot, step.unrecovered);
    json["L2"] = Stack(snapshot, step.tracked);
    json["L1_letters"] = StackLetters(step.unrecovered);
    json["L2_letters"] = StackLetters(step.tracked);
    steps.push_back(json);
  }
  return steps;
}

}  // namespace

std::string MakeSummaryJson(const Snapshot& snapshot, const MapEvaluation* evaluation, const GroundTruth* ground_truth,
                            const SummaryParts& parts) {
  std::vector<size_t> num_points;
  for (size_t c = 0; c < snapshot.components.size(); ++c) {
    num_points.push_back(ComponentPoints(snapshot, static_cast<int>(c)).size());
  }
  size_t num_keyframes = 0;
  for (const SnapshotSubmap& s : snapshot.submaps) num_keyframes += s.submap->keyframes.size();
  const bool any = !snapshot.components.empty();
  const MergedTransforms& merged = snapshot.model->Revision().transforms;
  OrderedJson json;
  json["version"] = MAPMEND_VERSION;
  json["revision"] = merged.revision;
  json["refined"] = merged.refined;
  json["final"] = merged.is_final;
  const FrameOfReference frame = any ? snapshot.components[0].frame : FrameOfReference();
  json["frame"] = frame.name;
  json["unit"] = frame.unit;
  if (!frame.note.empty()) json["frame_note"] = frame.note;
  json["frames_in"] = snapshot.num_frames_in;
  json["frames_tracked"] = snapshot.num_frames_tracked;
  json["frames_in_main"] = any ? snapshot.components[0].frames.size() : 0;
  json["losses"] =
      std::count_if(snapshot.submaps.begin(), snapshot.submaps.end(), [](const SnapshotSubmap& s) { return s.Lost(); });
  const std::vector<MapHole> holes = FindHoles(snapshot);
  json["holes_in_words"] = DescribeHoles(holes);
  json["holes"] = Holes(holes);
  json["keyframes_total"] = num_keyframes;
  json["keyframes_in_main"] = any ? snapshot.components[0].keyframes.size() : 0;
  json["points_in_main"] = any ? num_points[0] : 0;
  if (evaluation != nullptr && ground_truth != nullptr) {
    json["groundtruth"] = ground_truth->file;
    if (any) {
      const Evaluation& main = evaluation->components[0];
      AddErrors(main, &json);
      json["groundtruth_coverage"] = main.coverage;
      if (main.success) {
        json["groundtruth_scale"] = main.reference_from_estimate.scale;
      } else {
        json["groundtruth_problem"] = main.reason;
      }
    }
  }
  if (evaluation != nullptr) {
    double largest = 0;
    for (const DepthShare& share : evaluation->depth_shares) largest = std::max(largest, share.largest);
    if (largest > 0) json["max_error_of_depth"] = largest;
  }
  if (!parts.world.empty()) json["world"] = OrderedJson::parse(parts.world);
  if (!parts.gaps.empty()) json["gaps"] = OrderedJson::parse(parts.gaps);
  if (!parts.mosaic.empty()) json["mosaic"] = OrderedJson::parse(parts.mosaic);
  json["sessions"] = Sessions(snapshot);
  json["submaps"] = Submaps(snapshot, evaluation);
  json["components"] = Components(snapshot, evaluation, num_points);
  json["connections"] = Connections(snapshot, ListEdges(snapshot));
  json["likely_places"] = LikelyPlaces(snapshot);
  json["loops"] = Connections(snapshot, ListLoops(snapshot));
  json["restoration"] = Restorations(snapshot);
  return json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace mapmend

#include "procs/viewer_export/revision_codec.h"

#include <algorithm>
#include <cmath>
#include <mapmend/connection_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <stdexcept>
#include <string>

namespace mapmend {
namespace {

void Require(bool condition, const char* what) {
  if (!condition) throw std::runtime_error(std::string("bad message of the merger: ") + what);
}

bool IsFinite(const double* values, size_t count) {
  return std::all_of(values, values + count, [](double v) { return std::isfinite(v); });
}

bool IsRotation(const double* xyzw) {
  const double norm = std::hypot(std::hypot(xyzw[0], xyzw[1]), std::hypot(xyzw[2], xyzw[3]));
  return std::abs(norm - 1) < 0.01;
}

Similarity3 DecodeSimilarity(const double* values, const char* what) {
  Require(IsFinite(values, 8) && IsRotation(values + 3) && values[7] > 0, what);
  return SimilarityFromArray(values);
}

RefinedSubmap DecodePart(const revision_part_t& message) {
  const auto n = static_cast<size_t>(message.num_keyframes), points = static_cast<size_t>(message.num_points);
  Require(message.cam_from_root.size() == 7 * n && message.scale.size() == n, "num_pose_values of a revision part");
  Require(message.position.size() == 3 * points, "num_position_values of a revision part");
  RefinedSubmap refined;
  for (size_t i = 0; i < n; ++i) {
    const double* pose = message.cam_from_root.data() + 7 * i;
    Require(IsFinite(pose, 7) && IsRotation(pose + 3), "cam_from_root of a revision part");
    Require(std::isfinite(message.scale[i]) && message.scale[i] > 0, "scale of a revision part");
    refined.keyframes[KeyframeId(message.keyframe[i])] = {RigidFromArray(pose), message.scale[i]};
  }
  for (size_t i = 0; i < points; ++i) {
    const Eigen::Vector3d position = Eigen::Map<const Eigen::Vector3f>(message.position.data() + 3 * i).cast<double>();
    Require(position.allFinite(), "position of a revision part");
    refined.points[MapPointId(message.point[i])] = position;
  }
  for (size_t i = 0; i < static_cast<size_t>(message.num_fused); ++i) {
    refined.fused[MapPointId(message.fused_point[i])] = {message.into_session[i], MapPointId(message.into_point[i])};
  }
  return refined;
}

}  // namespace

EvaluatedConnection DecodeConnection(const connection_t& message) {
  EvaluatedConnection c;
  c.a = {message.session_a, SubmapId(message.submap_a)};
  c.b = {message.session_b, SubmapId(message.submap_b)};
  switch (message.verdict) {
    case connection_t::ACCEPTED:
      c.verdict = EvaluatedConnection::Verdict::kAccepted;
      break;
    case connection_t::REJECTED:
      c.verdict = EvaluatedConnection::Verdict::kRejected;
      break;
    case connection_t::DEACTIVATED:
      c.verdict = EvaluatedConnection::Verdict::kDeactivated;
      break;
    default:
      Require(false, "verdict of a connection");
  }
  c.reason = message.reason;
  c.num_connected_frames = message.num_connected_frames;
  c.num_common_points = message.num_common_points;
  Require(std::isfinite(message.median_angle_deg) && std::isfinite(message.strength), "strength of a connection");
  c.median_angle_deg = message.median_angle_deg;
  c.strength = message.strength;
  c.num_candidates = message.num_candidates;
  c.num_inliers = message.num_inliers;
  c.reprojection_error = std::isfinite(message.reprojection_error) ? message.reprojection_error : 0;
  // A rejected pair need not have a transform.
  const bool has_transform =
      IsFinite(message.b_from_a, 8) && IsRotation(message.b_from_a + 3) && message.b_from_a[7] > 0;
  Require(has_transform || c.verdict != EvaluatedConnection::Verdict::kAccepted, "b_from_a of a connection");
  if (has_transform) c.b_from_a = SimilarityFromArray(message.b_from_a);
  c.in_tree = message.in_tree != 0;
  return c;
}

MapRevision DecodeTransforms(const merged_transforms_t& message) {
  MapRevision map;
  map.revision = message.revision;
  map.refined = message.refined != 0;
  map.final = message.is_final != 0;
  for (const cursor_t& cursor : message.cursors) map.cursors[cursor.session] = cursor.seq;
  for (const merged_submap_t& submap : message.submaps) {
    map.submaps.push_back({{submap.session, SubmapId(submap.submap)},
                           submap.component,
                           DecodeSimilarity(submap.root_from_submap, "root_from_submap"),
                           submap.is_root != 0});
  }
  const auto n = static_cast<int32_t>(map.submaps.size());
  for (size_t i = 0; i < static_cast<size_t>(message.num_edges); ++i) {
    const int32_t a = message.edge_a[i], b = message.edge_b[i];
    Require(a >= 0 && a < n && b >= 0 && b < n, "edge of the tree");
    map.tree.emplace_back(map.submaps[a].key, map.submaps[b].key);
  }
  return map;
}

MapRevision DecodeRevision(const revision_t& message, const std::vector<revision_part_t>& parts) {
  MapRevision map = DecodeTransforms(message.transforms);
  for (const connection_t& connection : message.connections) map.connections.push_back(DecodeConnection(connection));
  for (const revision_part_t& part : parts) {
    Require(part.revision == map.revision, "revision of a part");
    map.refinement[{part.session, SubmapId(part.submap)}] = DecodePart(part);
  }
  return map;
}

}  // namespace mapmend

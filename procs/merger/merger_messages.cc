#include "procs/merger/merger_messages.h"

#include <algorithm>

namespace mapmend {
namespace {

template <typename T>
int32_t Count(const std::vector<T>& values) {
  return static_cast<int32_t>(values.size());
}

int8_t VerdictCode(Connection::Verdict verdict) {
  switch (verdict) {
    case Connection::Verdict::kAccepted:
      return connection_t::ACCEPTED;
    case Connection::Verdict::kRejected:
      return connection_t::REJECTED;
    case Connection::Verdict::kDeactivated:
      return connection_t::DEACTIVATED;
  }
  return connection_t::REJECTED;
}

}  // namespace

connection_t ToMessage(const Connection& connection) {
  connection_t message{};
  message.session_a = connection.a.session;
  message.submap_a = connection.a.submap.value;
  message.session_b = connection.b.session;
  message.submap_b = connection.b.submap.value;
  message.verdict = VerdictCode(connection.verdict);
  message.reason = connection.reason;
  message.num_connected_frames = connection.num_connected_frames;
  message.num_common_points = connection.num_common_points;
  message.median_angle_deg = connection.median_angle_deg;
  message.strength = connection.strength;
  message.num_candidates = connection.num_candidates;
  message.num_inliers = connection.num_inliers;
  message.reprojection_error = connection.median_error_px;
  const std::array<double, 8> b_from_a = ToArray(connection.b_from_a);
  std::copy(b_from_a.begin(), b_from_a.end(), message.b_from_a);
  message.in_tree = connection.in_tree ? 1 : 0;
  for (size_t i = 0; i < connection.evidence.size(); ++i) {
    if (!connection.agrees[i]) continue;
    message.keyframe_a.push_back(connection.evidence[i].keyframe_a.value);
    message.keyframe_b.push_back(connection.evidence[i].keyframe_b.value);
    message.pair_inliers.push_back(connection.evidence[i].num_inliers);
  }
  message.num_pairs = Count(message.keyframe_a);
  return message;
}

merged_transforms_t ToMessage(const MergedTransforms& transforms) {
  merged_transforms_t message{};
  message.revision = transforms.revision;
  for (const StreamCursor& c : transforms.cursors) {
    cursor_t cursor{};
    cursor.session = c.session;
    cursor.seq = c.seq;
    message.cursors.push_back(cursor);
  }
  message.num_cursors = Count(message.cursors);
  message.refined = transforms.refined ? 1 : 0;
  message.is_final = transforms.is_final ? 1 : 0;
  for (const MergedTransforms::Place& place : transforms.submaps) {
    merged_submap_t submap{};
    submap.session = place.key.session;
    submap.submap = place.key.submap.value;
    submap.component = place.component;
    const std::array<double, 8> root_from_submap = ToArray(place.root_from_submap);
    std::copy(root_from_submap.begin(), root_from_submap.end(), submap.root_from_submap);
    submap.is_root = place.is_root ? 1 : 0;
    message.submaps.push_back(submap);
  }
  message.num_submaps = Count(message.submaps);
  for (const auto& [a, b] : transforms.edges) {
    message.edge_a.push_back(a);
    message.edge_b.push_back(b);
  }
  message.num_edges = Count(message.edge_a);
  return message;
}

revision_t ToMessage(const MergedTransforms& transforms, const std::vector<Connection>& connections, int num_parts) {
  revision_t message{};
  message.transforms = ToMessage(transforms);
  for (const Connection& c : connections) message.connections.push_back(ToMessage(c));
  message.num_connections = Count(message.connections);
  message.num_parts = num_parts;
  return message;
}

revision_part_t ToMessage(const RefinedSubmap& submap, int64_t revision, int part) {
  revision_part_t message{};
  message.revision = revision;
  message.part = part;
  message.session = submap.key.session;
  message.submap = submap.key.submap.value;
  for (const RefinedSubmap::Keyframe& k : submap.keyframes) {
    message.keyframe.push_back(k.id.value);
    const std::array<double, 7> pose = ToArray(k.cam_from_root);
    message.cam_from_root.insert(message.cam_from_root.end(), pose.begin(), pose.end());
    message.scale.push_back(k.scale);
  }
  message.num_keyframes = Count(message.keyframe);
  message.num_pose_values = Count(message.cam_from_root);
  for (const RefinedSubmap::Point& p : submap.points) {
    message.point.push_back(p.id.value);
    message.position.insert(message.position.end(), p.position.data(), p.position.data() + 3);
  }
  message.num_points = Count(message.point);
  message.num_position_values = Count(message.position);
  for (const RefinedSubmap::Fused& f : submap.fused) {
    message.fused_point.push_back(f.id.value);
    message.into_session.push_back(f.into_submap.session);
    message.into_point.push_back(f.into.value);
  }
  message.num_fused = Count(message.fused_point);
  return message;
}

}  // namespace mapmend

#include "libs/wire/revision_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mapmend/connection_t.hpp>
#include <mapmend/graph_request_t.hpp>
#include <mapmend/graph_t.hpp>
#include <mapmend/merged_transforms_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>

#include "libs/wire/checked.h"
#include "libs/wire/codec.h"

namespace mapmend {
namespace {

using Verdict = EvaluatedConnection::Verdict;
using wire::Count;
using wire::Require;

constexpr double kRotationTolerance = 0.02;  // of the squared norm
constexpr int kMaxParts = 1000000;

SubmapKey ReadKey(const std::string& session, int32_t submap) {
  Require(IsSessionId(session), "session is not 1 to 64 letters, digits, - or _");
  Require(submap >= 0, "submap is negative");
  return {session, SubmapId(submap)};
}

bool IsSimilarity(const double* values) {
  return wire::AllFinite(values, 8) && wire::IsRotation(values + 3, kRotationTolerance) && values[7] > 0;
}

static_assert(static_cast<int>(Verdict::kAccepted) == connection_t::ACCEPTED &&
              static_cast<int>(Verdict::kRejected) == connection_t::REJECTED &&
              static_cast<int>(Verdict::kDeactivated) == connection_t::DEACTIVATED);

Verdict ReadVerdict(int8_t code) {
  Require(code >= connection_t::ACCEPTED && code <= connection_t::DEACTIVATED, "verdict of a connection is unknown");
  return static_cast<Verdict>(code);
}

connection_t ToMessage(const EvaluatedConnection& connection) {
  connection_t message{};
  message.session_a = connection.a.session;
  message.submap_a = connection.a.submap.value;
  message.session_b = connection.b.session;
  message.submap_b = connection.b.submap.value;
  message.verdict = static_cast<int8_t>(connection.verdict);
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
  for (const EvaluatedConnection::FramePair& pair : connection.pairs) {
    message.keyframe_a.push_back(pair.a.value);
    message.keyframe_b.push_back(pair.b.value);
    message.pair_inliers.push_back(pair.num_inliers);
  }
  message.num_pairs = Count(message.keyframe_a);
  return message;
}

EvaluatedConnection Read(const connection_t& m) {
  EvaluatedConnection c;
  c.a = ReadKey(m.session_a, m.submap_a);
  c.b = ReadKey(m.session_b, m.submap_b);
  c.verdict = ReadVerdict(m.verdict);
  c.reason = m.reason;
  c.num_connected_frames = m.num_connected_frames;
  c.num_common_points = m.num_common_points;
  Require(std::isfinite(m.median_angle_deg) && std::isfinite(m.strength), "strength of a connection is not finite");
  c.median_angle_deg = m.median_angle_deg;
  c.strength = m.strength;
  c.num_candidates = m.num_candidates;
  c.num_inliers = m.num_inliers;
  c.median_error_px = std::isfinite(m.reprojection_error) ? m.reprojection_error : 0;
  // A pair that is not used need not have a transform.
  Require(wire::AllFinite(m.b_from_a, 8), "b_from_a of a connection is not finite");
  const bool has_transform = IsSimilarity(m.b_from_a);
  Require(has_transform || c.verdict != Verdict::kAccepted, "b_from_a of a connection is no similarity");
  if (has_transform) c.b_from_a = wire::ReadSimilarity(m.b_from_a);
  c.in_tree = m.in_tree != 0;
  for (size_t i = 0; i < m.keyframe_a.size(); ++i)
    c.pairs.push_back({KeyframeId(m.keyframe_a[i]), KeyframeId(m.keyframe_b[i]), m.pair_inliers[i]});
  return c;
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

MergedTransforms Read(const merged_transforms_t& m) {
  MergedTransforms transforms;
  transforms.revision = m.revision;
  transforms.refined = m.refined != 0;
  transforms.is_final = m.is_final != 0;
  for (const cursor_t& cursor : m.cursors) transforms.cursors.push_back({cursor.session, cursor.seq});
  for (const merged_submap_t& s : m.submaps) {
    Require(IsSimilarity(s.root_from_submap), "root_from_submap is no similarity");
    transforms.submaps.push_back(
        {ReadKey(s.session, s.submap), s.component, wire::ReadSimilarity(s.root_from_submap), s.is_root != 0});
  }
  const int32_t n = Count(transforms.submaps);
  for (size_t i = 0; i < m.edge_a.size(); ++i) {
    const int32_t a = m.edge_a[i], b = m.edge_b[i];
    Require(a >= 0 && a < n && b >= 0 && b < n, "edge of the tree names no submap");
    transforms.edges.emplace_back(a, b);
  }
  return transforms;
}

std::vector<EvaluatedConnection> Read(const std::vector<connection_t>& messages) {
  std::vector<EvaluatedConnection> connections;
  for (const connection_t& message : messages) connections.push_back(Read(message));
  return connections;
}

std::vector<connection_t> ToMessages(const std::vector<EvaluatedConnection>& connections) {
  std::vector<connection_t> messages;
  for (const EvaluatedConnection& connection : connections) messages.push_back(ToMessage(connection));
  return messages;
}

revision_t ToMessage(const RevisionHead& head) {
  revision_t message{};
  message.transforms = ToMessage(head.transforms);
  message.connections = ToMessages(head.connections);
  message.num_connections = Count(message.connections);
  message.num_parts = head.num_parts;
  return message;
}

RevisionHead Read(const revision_t& m) {
  Require(m.transforms.revision >= 0, "revision is negative");
  Require(m.num_parts >= 0 && m.num_parts <= kMaxParts, "num_parts is out of range");
  return {Read(m.transforms), Read(m.connections), m.num_parts};
}

revision_part_t ToMessage(const RevisionPart& part) {
  const RefinedSubmap& submap = part.submap;
  revision_part_t message{};
  message.revision = part.revision;
  message.part = part.part;
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
    message.into_session.push_back(f.into_session);
    message.into_point.push_back(f.into.value);
  }
  message.num_fused = Count(message.fused_point);
  return message;
}

RevisionPart Read(const revision_part_t& m) {
  const size_t num_keyframes = m.keyframe.size(), num_points = m.point.size();
  Require(m.revision >= 0 && m.part >= 0 && m.part < kMaxParts, "revision or part is out of range");
  Require(m.cam_from_root.size() == 7 * num_keyframes, "num_pose_values is not 7 * num_keyframes");
  Require(m.position.size() == 3 * num_points, "num_position_values is not 3 * num_points");
  Require(wire::AllFinite(m.position), "position is not finite");
  RevisionPart part{m.revision, m.part, {ReadKey(m.session, m.submap), {}, {}, {}}};
  for (size_t i = 0; i < num_keyframes; ++i) {
    const double* pose = m.cam_from_root.data() + 7 * i;
    Require(wire::AllFinite(pose, 7) && wire::IsRotation(pose + 3, kRotationTolerance), "cam_from_root is no pose");
    Require(std::isfinite(m.scale[i]) && m.scale[i] > 0, "scale is not positive");
    part.submap.keyframes.push_back({KeyframeId(m.keyframe[i]), wire::ReadRigid(pose), m.scale[i]});
  }
  for (size_t i = 0; i < num_points; ++i) {
    const float* position = m.position.data() + 3 * i;
    part.submap.points.push_back({MapPointId(m.point[i]), {position[0], position[1], position[2]}});
  }
  for (size_t i = 0; i < m.fused_point.size(); ++i)
    part.submap.fused.push_back({MapPointId(m.fused_point[i]), m.into_session[i], MapPointId(m.into_point[i])});
  return part;
}

graph_request_t ToMessage(const GraphRequest& request) {
  graph_request_t message{};
  message.id = request.id;
  message.requester = request.requester;
  return message;
}

GraphRequest Read(const graph_request_t& m) { return {{m.id, m.requester}}; }

graph_t ToMessage(const GraphReply& reply) {
  graph_t message{};
  message.id = reply.id;
  message.requester = reply.requester;
  message.transforms = ToMessage(reply.transforms);
  message.num_decisions = reply.num_decisions;
  message.connections = ToMessages(reply.connections);
  message.num_connections = Count(message.connections);
  return message;
}

GraphReply Read(const graph_t& m) {
  return {{m.id, m.requester}, Read(m.transforms), m.num_decisions, Read(m.connections)};
}

}  // namespace

template <>
std::vector<uint8_t> Encode(const EvaluatedConnection& connection) {
  return EncodeMessage(ToMessage(connection));
}

template <>
Decoded<EvaluatedConnection> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<EvaluatedConnection, connection_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const MergedTransforms& transforms) {
  return EncodeMessage(ToMessage(transforms));
}

template <>
Decoded<MergedTransforms> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<MergedTransforms, merged_transforms_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RevisionHead& head) {
  return EncodeMessage(ToMessage(head));
}

template <>
Decoded<RevisionHead> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RevisionHead, revision_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RevisionPart& part) {
  return EncodeMessage(ToMessage(part));
}

template <>
Decoded<RevisionPart> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RevisionPart, revision_part_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const GraphRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<GraphRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<GraphRequest, graph_request_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const GraphReply& reply) {
  return EncodeMessage(ToMessage(reply));
}

template <>
Decoded<GraphReply> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<GraphReply, graph_t>(data, size, Read);
}

}  // namespace mapmend

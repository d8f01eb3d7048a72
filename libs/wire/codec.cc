#include "libs/wire/codec.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <mapmend/gps_t.hpp>
#include <mapmend/keyframe_t.hpp>
#include <mapmend/map_update_t.hpp>
#include <mapmend/session_t.hpp>
#include <mapmend/submap_t.hpp>
#include <mapmend/wide_features_t.hpp>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/retrieval/inverted_index.h"
#include "libs/wire/checked.h"
#include "libs/wire/fix_message.h"

namespace mapmend {
namespace {

constexpr int kMaxOctave = 63;
constexpr int kMaxFrame = 1 << 30;
constexpr int kMaxId = 1 << 30;
constexpr size_t kMaxText = 4096;         // characters of names and reasons
constexpr size_t kMaxSettings = 1 << 20;  // characters of the settings

using wire::AllFinite;
using wire::Refused;
using wire::Require;

Rigid3 DecodePose(const double* values) {
  Require(AllFinite(values, 7), "pose is not finite");
  Require(wire::IsRotation(values + 3, 1e-3), "rotation is not a unit quaternion");
  return wire::ReadRigid(values);
}

RecordHeader DecodeHeader(const record_header_t& message) {
  Require(IsSessionId(message.session), "session is not 1 to 64 letters, digits, - or _");
  Require(message.seq >= 0, "seq is negative");
  return {message.session, message.seq, message.utime};
}

void RequireText(const std::string& text, size_t limit = kMaxText) {
  Require(text.size() <= limit && text.find('\0') == std::string::npos, "text is too long or holds a zero byte");
}

RecordBody Decode(const session_t& m) {
  Require(m.num_frames >= 0 && m.num_frames <= kMaxFrame + 1, "num_frames is out of range");
  if (m.event == session_t::ENDED) return SessionEnded{m.num_frames};
  Require(m.event == session_t::STARTED, "unknown event");
  SessionStarted body;
  for (const std::string* text : {&m.version, &m.vehicle, &m.source, &m.vocabulary_hash}) RequireText(*text);
  RequireText(m.settings, kMaxSettings);
  body.version = m.version;
  body.vehicle = m.vehicle;
  body.source = m.source;
  Require(ParseCameraModel(m.camera_model, &body.camera.model), "camera_model is not known");
  Require(m.num_camera_params == 4 + body.camera.NumCoefficients(), "num_camera_params does not fit camera_model");
  Require(AllFinite(m.camera_params.data(), m.camera_params.size()), "camera_params are not finite");
  body.camera.fx = m.camera_params[0];
  body.camera.fy = m.camera_params[1];
  body.camera.cx = m.camera_params[2];
  body.camera.cy = m.camera_params[3];
  std::copy(m.camera_params.begin() + 4, m.camera_params.end(), body.camera.distortion.begin());
  Require(m.width > 0 && m.height > 0 && m.width <= 65536 && m.height <= 65536, "width or height is out of range");
  body.camera.width = body.pinhole.width = m.width;
  body.camera.height = body.pinhole.height = m.height;
  const double pinhole[4] = {m.fx, m.fy, m.cx, m.cy};
  Require(AllFinite(pinhole, 4) && m.fx > 0 && m.fy > 0, "fx, fy, cx, cy are out of range");
  body.pinhole.fx = m.fx;
  body.pinhole.fy = m.fy;
  body.pinhole.cx = m.cx;
  body.pinhole.cy = m.cy;
  Require(std::isfinite(m.scale_factor) && m.scale_factor >= 1 && m.scale_factor <= 4, "scale_factor is out of range");
  Require(m.num_levels >= 1 && m.num_levels <= kMaxOctave + 1, "num_levels is out of range");
  body.pyramid.scale_factor = m.scale_factor;
  body.pyramid.num_levels = m.num_levels;
  body.vocabulary_hash = m.vocabulary_hash;
  body.settings_json = m.settings;
  body.num_frames = m.num_frames;
  return body;
}

RecordBody Decode(const submap_t& m) {
  Require(m.submap >= 0 && m.submap <= kMaxId, "submap is out of range");
  if (m.event == submap_t::STARTED) return SubmapStarted{SubmapId(m.submap)};
  Require(m.event == submap_t::ENDED, "unknown event");
  RequireText(m.reason);
  RequireText(m.detail);
  Require(m.last_frame >= -1 && m.last_frame <= kMaxFrame, "last_frame is out of range");
  return SubmapEnded{SubmapId(m.submap), m.reason, m.detail, m.last_frame, m.last_utime};
}

RecordBody Decode(const keyframe_t& m) {
  Require(m.submap >= 0 && m.submap <= kMaxId && m.keyframe >= 0 && m.keyframe <= kMaxId,
          "submap or keyframe is out of range");
  Require(m.frame >= -1 && m.frame <= kMaxFrame, "frame is out of range");
  const auto n = static_cast<size_t>(m.num_features);
  Require(m.descriptors.size() == n * sizeof(Descriptor), "num_descriptor_bytes is not 32 * num_features");
  Require(m.colors.empty() || m.colors.size() == 3 * n, "num_color_bytes is not 3 * num_features");
  Require(AllFinite(m.x) && AllFinite(m.y) && AllFinite(m.angle), "feature is not finite");
  KeyframeRecord body;
  body.submap = SubmapId(m.submap);
  body.keyframe = KeyframeId(m.keyframe);
  body.frame = m.frame;
  body.cam_from_submap = DecodePose(m.cam_from_submap);
  body.features.keypoints.resize(n);
  body.features.descriptors.resize(n);
  body.features.colors.resize(m.colors.empty() ? 0 : n);
  body.map_points.resize(n);
  for (size_t i = 0; i < n; ++i) {
    Require(m.octave[i] >= 0 && m.octave[i] <= kMaxOctave, "octave is out of range");
    Require(m.map_point[i] >= -1 && m.map_point[i] <= kMaxId, "map_point is out of range");
    Require(m.word[i] >= -1 && m.node[i] >= -1, "word or node is out of range");
    body.features.keypoints[i] = {{m.x[i], m.y[i]}, m.angle[i], m.octave[i]};
    body.map_points[i] = MapPointId(m.map_point[i]);
  }
  if (n > 0) std::memcpy(body.features.descriptors.data(), m.descriptors.data(), m.descriptors.size());
  if (!m.colors.empty()) std::memcpy(body.features.colors.data(), m.colors.data(), m.colors.size());
  body.words = m.word;
  body.nodes = m.node;
  int32_t previous = -1;
  for (size_t i = 0; i < m.bow_word.size(); ++i) {
    Require(m.bow_word[i] > previous, "bow_word does not ascend");
    Require(m.bow_word[i] < InvertedIndex::kMaxWords, "bow_word is out of range");
    Require(std::isfinite(m.bow_weight[i]) && m.bow_weight[i] > 0 && m.bow_weight[i] < 1.001f,
            "bow_weight is out of range");
    previous = m.bow_word[i];
  }
  body.bow = {m.bow_word, m.bow_weight};
  return body;
}

RecordBody Decode(const map_update_t& m) {
  Require(m.submap >= 0 && m.submap <= kMaxId, "submap is out of range");
  Require(m.num_pose_values == 7 * static_cast<int64_t>(m.num_keyframes), "num_pose_values is not 7 * num_keyframes");
  Require(m.num_position_values == 3 * static_cast<int64_t>(m.num_points), "num_position_values is not 3 * num_points");
  Require(m.num_frame_pose_values == 7 * static_cast<int64_t>(m.num_frames),
          "num_frame_pose_values is not 7 * num_frames");
  Require(AllFinite(m.position), "position is not finite");
  const auto require_ids = [](const std::vector<int32_t>& ids) {
    for (const int32_t id : ids) Require(id >= 0 && id <= kMaxId, "id is out of range");
  };
  for (const std::vector<int32_t>* ids :
       {&m.keyframe, &m.point, &m.removed_keyframe, &m.removed_point, &m.frame_keyframe, &m.observation_keyframe,
        &m.observation_feature, &m.frame}) {
    require_ids(*ids);
  }
  MapUpdate body;
  body.submap = SubmapId(m.submap);
  for (size_t i = 0; i < m.keyframe.size(); ++i) {
    body.keyframes.push_back({KeyframeId(m.keyframe[i]), DecodePose(&m.cam_from_submap[7 * i])});
  }
  for (size_t i = 0; i < m.point.size(); ++i) {
    body.points.push_back({MapPointId(m.point[i]), {m.position[3 * i], m.position[3 * i + 1], m.position[3 * i + 2]}});
  }
  for (size_t i = 0; i < m.observation_point.size(); ++i) {
    Require(m.observation_point[i] >= -1, "observation_point is out of range");
    body.observations.push_back(
        {KeyframeId(m.observation_keyframe[i]), m.observation_feature[i], MapPointId(m.observation_point[i])});
  }
  for (const int32_t id : m.removed_keyframe) body.removed_keyframes.push_back(KeyframeId(id));
  for (const int32_t id : m.removed_point) body.removed_points.push_back(MapPointId(id));
  for (size_t i = 0; i < m.frame.size(); ++i) {
    body.frames.push_back(
        {m.frame[i], m.frame_utime[i], KeyframeId(m.frame_keyframe[i]), DecodePose(&m.cam_from_keyframe[7 * i])});
  }
  return body;
}

RecordBody Decode(const wide_features_t& m) {
  Require(m.submap >= 0 && m.submap <= kMaxId && m.keyframe >= -1 && m.keyframe <= kMaxId,
          "submap or keyframe is out of range");
  Require(m.frame >= -1 && m.frame <= kMaxFrame, "frame is out of range");
  const auto n = static_cast<size_t>(m.num_features);
  Require(m.descriptors.size() == n * sizeof(WideDescriptor), "num_descriptor_bytes is not 128 * num_features");
  Require(AllFinite(m.x) && AllFinite(m.y), "feature is not finite");
  Require(std::all_of(m.descriptors.begin(), m.descriptors.end(), [](uint8_t v) { return v <= 127; }),
          "descriptor is out of range");
  WideFeaturesRecord body;
  body.submap = SubmapId(m.submap);
  body.keyframe = KeyframeId(m.keyframe);
  body.frame = m.frame;
  body.features.keypoints.resize(n);
  body.features.descriptors.resize(n);
  for (size_t i = 0; i < n; ++i) body.features.keypoints[i] = {{m.x[i], m.y[i]}, m.size[i], m.angle[i]};
  if (n > 0) std::memcpy(body.features.descriptors.data(), m.descriptors.data(), m.descriptors.size());
  return body;
}

RecordBody Decode(const gps_t& m) {
  PositionsRecord body;
  for (const gps_fix_t& fix : m.fixes) {
    body.fixes.push_back(wire::ReadFix(fix));
    const std::string problem = ProblemOf(body.fixes.back());
    Require(problem.empty(), problem.c_str());
  }
  return body;
}

template <typename Message>
Record DecodeAs(const uint8_t* data, int size) {
  Message message{};
  if (!DecodeMessage(data, size, &message)) {
    throw Refused((std::string("not a ") + Message::getTypeName() + " of " + std::to_string(size) + " bytes").c_str());
  }
  Record record;
  record.header = DecodeHeader(message.header);
  record.body = Decode(message);
  return record;
}

}  // namespace

std::optional<RecordHeader> PeekHeader(const uint8_t* data, int size) {
  constexpr int kHashSize = 8;
  record_header_t header{};
  try {
    if (size < kHashSize || header._decodeNoHash(data, kHashSize, size - kHashSize) < 0) return std::nullopt;
  } catch (const std::exception&) {  // a string of negative length
    return std::nullopt;
  }
  if (!IsSessionId(header.session) || header.seq < 0) return std::nullopt;
  return RecordHeader{header.session, header.seq, header.utime};
}

bool IsSessionId(const std::string& text) {
  return !text.empty() && text.size() <= 64 && std::all_of(text.begin(), text.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_';
  });
}

bool IsRecordChannel(const std::string& channel) {
  return channel == channels::kSession || channel == channels::kSubmap || channel == channels::kKeyframe ||
         channel == channels::kMapUpdate || channel == channels::kWideFeatures || channel == channels::kPositions;
}

DecodedRecord DecodeRecord(const EncodedRecord& record) {
  return DecodeRecord(record.channel, record.data.data(), static_cast<int>(record.data.size()));
}

DecodedRecord DecodeRecord(const std::string& channel, const uint8_t* data, int size) {
  DecodedRecord result;
  try {
    if (channel == channels::kSession) {
      result.record = DecodeAs<session_t>(data, size);
    } else if (channel == channels::kSubmap) {
      result.record = DecodeAs<submap_t>(data, size);
    } else if (channel == channels::kKeyframe) {
      result.record = DecodeAs<keyframe_t>(data, size);
    } else if (channel == channels::kMapUpdate) {
      result.record = DecodeAs<map_update_t>(data, size);
    } else if (channel == channels::kWideFeatures) {
      result.record = DecodeAs<wide_features_t>(data, size);
    } else if (channel == channels::kPositions) {
      result.record = DecodeAs<gps_t>(data, size);
    } else {
      result.error = channel + " carries no records";
    }
  } catch (const Refused& e) {
    result.error = channel + ": " + e.what();
  }
  return result;
}

}  // namespace mapmend

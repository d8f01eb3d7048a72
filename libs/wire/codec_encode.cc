#include <algorithm>
#include <cstring>
#include <mapmend/gps_t.hpp>
#include <mapmend/keyframe_t.hpp>
#include <mapmend/map_update_t.hpp>
#include <mapmend/session_t.hpp>
#include <mapmend/submap_t.hpp>
#include <mapmend/wide_features_t.hpp>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/wire/checked.h"
#include "libs/wire/codec.h"
#include "libs/wire/fix_message.h"

namespace mapmend {
namespace {

using wire::Count;

record_header_t ToMessage(const RecordHeader& header) {
  record_header_t message{};
  message.session = header.session;
  message.seq = header.seq;
  message.utime = header.utime;
  return message;
}

session_t ToMessage(const RecordHeader& header, const SessionStarted& body) {
  session_t message{};
  message.header = ToMessage(header);
  message.event = session_t::STARTED;
  message.version = body.version;
  message.vehicle = body.vehicle;
  message.source = body.source;
  message.camera_model = body.camera.ModelName();
  message.camera_params = {body.camera.fx, body.camera.fy, body.camera.cx, body.camera.cy};
  message.camera_params.insert(message.camera_params.end(), body.camera.distortion.begin(),
                               body.camera.distortion.begin() + body.camera.NumCoefficients());
  message.num_camera_params = Count(message.camera_params);
  message.width = body.pinhole.width;
  message.height = body.pinhole.height;
  message.fx = body.pinhole.fx;
  message.fy = body.pinhole.fy;
  message.cx = body.pinhole.cx;
  message.cy = body.pinhole.cy;
  message.scale_factor = body.pyramid.scale_factor;
  message.num_levels = body.pyramid.num_levels;
  message.vocabulary_hash = body.vocabulary_hash;
  message.settings = body.settings_json;
  message.num_frames = body.num_frames;
  return message;
}

session_t ToMessage(const RecordHeader& header, const SessionEnded& body) {
  session_t message{};
  message.header = ToMessage(header);
  message.event = session_t::ENDED;
  message.num_frames = body.num_frames;
  return message;
}

submap_t ToMessage(const RecordHeader& header, const SubmapStarted& body) {
  submap_t message{};
  message.header = ToMessage(header);
  message.event = submap_t::STARTED;
  message.submap = body.submap.value;
  message.last_frame = -1;
  return message;
}

submap_t ToMessage(const RecordHeader& header, const SubmapEnded& body) {
  submap_t message{};
  message.header = ToMessage(header);
  message.event = submap_t::ENDED;
  message.submap = body.submap.value;
  message.reason = body.reason;
  message.detail = body.detail;
  message.last_frame = body.last_frame;
  message.last_utime = body.last_utime;
  return message;
}

keyframe_t ToMessage(const RecordHeader& header, const KeyframeRecord& body) {
  const Features& features = body.features;
  const size_t n = features.keypoints.size();
  if (features.descriptors.size() != n || body.map_points.size() != n || body.words.size() != n ||
      body.nodes.size() != n || (!features.colors.empty() && features.colors.size() != n) ||
      body.bow.words.size() != body.bow.weights.size()) {
    throw std::invalid_argument("keyframe " + std::to_string(body.keyframe.value) + ": feature counts disagree");
  }
  keyframe_t message{};
  message.header = ToMessage(header);
  message.submap = body.submap.value;
  message.keyframe = body.keyframe.value;
  message.frame = body.frame;
  const auto pose = ToArray(body.cam_from_submap);
  std::copy(pose.begin(), pose.end(), message.cam_from_submap);
  message.num_features = static_cast<int32_t>(n);
  message.x.resize(n);
  message.y.resize(n);
  message.angle.resize(n);
  message.octave.resize(n);
  message.map_point.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    message.x[i] = keypoint.pixel.x();
    message.y[i] = keypoint.pixel.y();
    message.angle[i] = keypoint.angle;
    message.octave[i] = keypoint.octave;
    message.map_point[i] = body.map_points[i].value;
  }
  message.word = body.words;
  message.node = body.nodes;
  message.descriptors.resize(n * sizeof(Descriptor));
  if (n > 0) std::memcpy(message.descriptors.data(), features.descriptors.data(), message.descriptors.size());
  message.num_descriptor_bytes = Count(message.descriptors);
  for (const auto& color : features.colors) message.colors.insert(message.colors.end(), color.begin(), color.end());
  message.num_color_bytes = Count(message.colors);
  message.bow_word = body.bow.words;
  message.bow_weight = body.bow.weights;
  message.num_words = Count(message.bow_word);
  return message;
}

map_update_t ToMessage(const RecordHeader& header, const MapUpdate& body) {
  map_update_t message{};
  message.header = ToMessage(header);
  message.submap = body.submap.value;
  const auto append_pose = [](const Rigid3& pose, std::vector<double>* values) {
    const auto array = ToArray(pose);
    values->insert(values->end(), array.begin(), array.end());
  };
  for (const auto& [keyframe, pose] : body.keyframes) {
    message.keyframe.push_back(keyframe.value);
    append_pose(pose, &message.cam_from_submap);
  }
  for (const auto& [point, position] : body.points) {
    message.point.push_back(point.value);
    message.position.insert(message.position.end(), {position.x(), position.y(), position.z()});
  }
  for (const ObservationChange& change : body.observations) {
    message.observation_keyframe.push_back(change.keyframe.value);
    message.observation_feature.push_back(change.feature);
    message.observation_point.push_back(change.point.value);
  }
  for (const KeyframeId id : body.removed_keyframes) message.removed_keyframe.push_back(id.value);
  for (const MapPointId id : body.removed_points) message.removed_point.push_back(id.value);
  for (const TrackedFrame& frame : body.frames) {
    message.frame.push_back(frame.frame);
    message.frame_utime.push_back(frame.utime);
    message.frame_keyframe.push_back(frame.keyframe.value);
    append_pose(frame.cam_from_keyframe, &message.cam_from_keyframe);
  }
  message.num_keyframes = Count(message.keyframe);
  message.num_pose_values = Count(message.cam_from_submap);
  message.num_points = Count(message.point);
  message.num_position_values = Count(message.position);
  message.num_observations = Count(message.observation_point);
  message.num_removed_keyframes = Count(message.removed_keyframe);
  message.num_removed_points = Count(message.removed_point);
  message.num_frames = Count(message.frame);
  message.num_frame_pose_values = Count(message.cam_from_keyframe);
  return message;
}

wide_features_t ToMessage(const RecordHeader& header, const WideFeaturesRecord& body) {
  const WideFeatures& features = body.features;
  const size_t n = features.keypoints.size();
  if (features.descriptors.size() != n)
    throw std::invalid_argument("wide features of keyframe " + std::to_string(body.keyframe.value) +
                                ": feature counts disagree");
  wide_features_t message{};
  message.header = ToMessage(header);
  message.submap = body.submap.value;
  message.keyframe = body.keyframe.value;
  message.frame = body.frame;
  message.num_features = static_cast<int32_t>(n);
  for (const WideKeypoint& keypoint : features.keypoints) {
    message.x.push_back(keypoint.pixel.x());
    message.y.push_back(keypoint.pixel.y());
    message.size.push_back(keypoint.size);
    message.angle.push_back(keypoint.angle);
  }
  message.descriptors.resize(n * sizeof(WideDescriptor));
  if (n > 0) std::memcpy(message.descriptors.data(), features.descriptors.data(), message.descriptors.size());
  message.num_descriptor_bytes = Count(message.descriptors);
  return message;
}

gps_t ToMessage(const RecordHeader& header, const PositionsRecord& body) {
  gps_t message{};
  message.header = ToMessage(header);
  for (const PositionFix& fix : body.fixes) message.fixes.push_back(wire::WriteFix(fix));
  message.num_fixes = Count(message.fixes);
  return message;
}

const char* ChannelOf(const RecordBody& body) {
  switch (body.index()) {
    case 0:
    case 1:
      return channels::kSession;
    case 2:
    case 3:
      return channels::kSubmap;
    case 4:
      return channels::kKeyframe;
    case 5:
      return channels::kMapUpdate;
    case 6:
      return channels::kWideFeatures;
    default:
      return channels::kPositions;
  }
}

}  // namespace

EncodedRecord EncodeRecord(const Record& record) {
  EncodedRecord encoded;
  encoded.session = record.header.session;
  encoded.seq = record.header.seq;
  encoded.channel = ChannelOf(record.body);
  encoded.data =
      std::visit([&](const auto& body) { return EncodeMessage(ToMessage(record.header, body)); }, record.body);
  return encoded;
}

}  // namespace mapmend

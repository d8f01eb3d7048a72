#include "libs/wire/stream_codec.h"

#include <algorithm>
#include <mapmend/ack_t.hpp>
#include <mapmend/frame_pose_t.hpp>
#include <mapmend/record_checksum_t.hpp>
#include <mapmend/store_started_t.hpp>
#include <mapmend/stream_state_t.hpp>

#include "libs/wire/checked.h"
#include "libs/wire/codec.h"
#include "libs/wire/fix_message.h"

namespace mapmend {
namespace {

using wire::Count;
using wire::Require;

constexpr int64_t kMaxSeq = int64_t{1} << 62;

stream_state_t ToMessage(const StreamState& state) {
  stream_state_t message{};
  message.session = state.session;
  message.first = state.first;
  message.last = state.last;
  message.utime = state.utime;
  message.ended = state.ended ? 1 : 0;
  return message;
}

StreamState Read(const stream_state_t& m) { return {m.session, m.first, m.last, m.utime, m.ended != 0}; }

ack_t ToMessage(const StreamAck& ack) {
  ack_t message{};
  message.session = ack.session;
  message.cumulative = ack.cumulative;
  message.missing = ack.missing;
  message.num_missing = Count(message.missing);
  message.error = ack.error;
  return message;
}

StreamAck Read(const ack_t& m) { return {m.session, m.cumulative, m.missing, m.error}; }

store_started_t ToMessage(const StoreStarted& started) {
  store_started_t message{};
  message.incarnation = started.incarnation;
  return message;
}

StoreStarted Read(const store_started_t& m) { return {m.incarnation}; }

record_checksum_t ToMessage(const RecordChecksumList& checksums) {
  record_checksum_t message{};
  message.session = checksums.session;
  message.first_seq = checksums.first_seq;
  for (const uint32_t crc32 : checksums.crc32) message.crc32.push_back(static_cast<int32_t>(crc32));
  message.num_records = Count(message.crc32);
  return message;
}

RecordChecksumList Read(const record_checksum_t& m) {
  Require(IsSessionId(m.session), "session is not 1 to 64 letters, digits, - or _");
  Require(m.first_seq >= 0 && m.first_seq <= kMaxSeq, "first_seq is out of range");
  return {m.session, m.first_seq, {m.crc32.begin(), m.crc32.end()}};
}

frame_pose_t ToMessage(const FramePose& pose) {
  frame_pose_t message{};
  message.session = pose.submap.session;
  message.submap = pose.submap.submap.value;
  message.utime = pose.utime;
  message.frame = pose.frame;
  message.state = pose.state;
  const auto cam_from_submap = ToArray(pose.cam_from_submap);
  std::copy(cam_from_submap.begin(), cam_from_submap.end(), message.cam_from_submap);
  message.num_inliers = pose.num_inliers;
  return message;
}

FramePose Read(const frame_pose_t& m) {
  FramePose pose{{m.session, SubmapId(m.submap)}, m.utime, m.frame, m.state, {}, m.num_inliers};
  const bool is_finite = wire::AllFinite(m.cam_from_submap, 7);
  if (is_finite) pose.cam_from_submap = wire::ReadRigid(m.cam_from_submap);
  if (!is_finite || m.submap < 0) pose.submap.submap = SubmapId();
  return pose;
}

}  // namespace

template <>
std::vector<uint8_t> Encode(const StreamState& state) {
  return EncodeMessage(ToMessage(state));
}

template <>
Decoded<StreamState> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<StreamState, stream_state_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const StreamAck& ack) {
  return EncodeMessage(ToMessage(ack));
}

template <>
Decoded<StreamAck> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<StreamAck, ack_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const StoreStarted& started) {
  return EncodeMessage(ToMessage(started));
}

template <>
Decoded<StoreStarted> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<StoreStarted, store_started_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const RecordChecksumList& checksums) {
  return EncodeMessage(ToMessage(checksums));
}

template <>
Decoded<RecordChecksumList> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<RecordChecksumList, record_checksum_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const FramePose& pose) {
  return EncodeMessage(ToMessage(pose));
}

template <>
Decoded<FramePose> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<FramePose, frame_pose_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const PositionFix& fix) {
  return EncodeMessage(wire::WriteFix(fix));
}

template <>
Decoded<PositionFix> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<PositionFix, gps_fix_t>(data, size, [](const gps_fix_t& m) {
    const PositionFix fix = wire::ReadFix(m);
    const std::string problem = ProblemOf(fix);
    wire::Require(problem.empty(), problem.c_str());
    return fix;
  });
}

}  // namespace mapmend

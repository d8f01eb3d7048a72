#include "libs/wire/query_codec.h"

#include <mapmend/bow_query_t.hpp>
#include <mapmend/bow_result_t.hpp>
#include <mapmend/close_session_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/progress_request_t.hpp>
#include <mapmend/progress_t.hpp>
#include <mapmend/session_closed_t.hpp>

#include "libs/wire/addressed.h"

namespace mapmend {
namespace {

using wire::AboutSession;
using wire::AddressedAs;
using wire::Addressing;
using wire::Count;
using wire::ReadStatus;
using wire::Require;

// The statuses of an answer have the same numbers here and there.
static_assert(static_cast<int>(BowAnswer::Status::kNotYet) == bow_result_t::NOT_YET);
static_assert(static_cast<int>(BowAnswer::Status::kUnknownKeyframe) == bow_result_t::UNKNOWN_KEYFRAME);
static_assert(static_cast<int>(BowAnswer::Status::kBadQuery) == bow_result_t::BAD_QUERY);
static_assert(static_cast<int>(FetchAnswer::Status::kUnknownSession) == fetched_t::UNKNOWN_SESSION);
static_assert(static_cast<int>(FetchAnswer::Status::kBadRequest) == fetched_t::BAD_REQUEST);
static_assert(static_cast<int>(SessionProgress::Status::kUnknownSession) == progress_t::UNKNOWN_SESSION);
static_assert(static_cast<int>(CloseAnswer::Status::kUnknownSession) == session_closed_t::UNKNOWN_SESSION);
static_assert(static_cast<int>(CloseAnswer::Status::kStillAlive) == session_closed_t::STILL_ALIVE);

std::vector<cursor_t> ToMessages(const std::vector<StreamCursor>& cursors) {
  std::vector<cursor_t> messages;
  for (const StreamCursor& c : cursors) {
    cursor_t message{};
    message.session = c.session;
    message.seq = c.seq;
    messages.push_back(message);
  }
  return messages;
}

std::vector<StreamCursor> Read(const std::vector<cursor_t>& messages) {
  std::vector<StreamCursor> cursors;
  for (const cursor_t& m : messages) cursors.push_back({m.session, m.seq});
  return cursors;
}

bow_query_t ToMessage(const BowQuery& query) {
  auto message = Addressing<bow_query_t>(query);
  message.session = query.session;
  message.keyframe = query.keyframe.value;
  message.cursors = ToMessages(query.cursors);
  message.num_cursors = Count(message.cursors);
  message.max_results = query.max_results;
  message.same_submap = query.same_submap ? 1 : 0;
  return message;
}

BowQuery Read(const bow_query_t& m) {
  auto query = AddressedAs<BowQuery>(m);
  query.session = m.session;
  query.keyframe = KeyframeId(m.keyframe);
  query.cursors = Read(m.cursors);
  query.max_results = m.max_results;
  query.same_submap = m.same_submap != 0;
  return query;
}

bow_candidate_t ToMessage(const BowProposal& proposal) {
  bow_candidate_t message{};
  message.session = proposal.session;
  message.submap = proposal.submap.value;
  message.keyframe = proposal.keyframe.value;
  message.common_words = proposal.common_words;
  message.score = proposal.score;
  message.group_score = proposal.group_score;
  return message;
}

bow_result_t ToMessage(const BowAnswer& answer) {
  auto message = Addressing<bow_result_t>(answer);
  message.status = static_cast<int8_t>(answer.status);
  message.session = answer.session;
  message.keyframe = answer.keyframe.value;
  message.adjacent = answer.adjacent.value;
  message.nearby = answer.nearby.value;
  message.n0 = answer.n0;
  message.n1 = answer.n1;
  message.k = answer.k;
  message.s0 = answer.s0;
  message.s1 = answer.s1;
  message.l = answer.l;
  message.max_common_words = answer.max_common_words;
  message.best_group_score = answer.best_group_score;
  for (const BowProposal& proposal : answer.proposals) message.candidates.push_back(ToMessage(proposal));
  message.num_candidates = Count(message.candidates);
  return message;
}

BowAnswer Read(const bow_result_t& m) {
  auto answer = AddressedAs<BowAnswer>(m);
  answer.status = ReadStatus(m.status, BowAnswer::Status::kBadQuery);
  answer.session = m.session;
  answer.keyframe = KeyframeId(m.keyframe);
  answer.adjacent = KeyframeId(m.adjacent);
  answer.nearby = KeyframeId(m.nearby);
  answer.n0 = m.n0;
  answer.n1 = m.n1;
  answer.k = m.k;
  answer.s0 = m.s0;
  answer.s1 = m.s1;
  answer.l = m.l;
  answer.max_common_words = m.max_common_words;
  answer.best_group_score = m.best_group_score;
  for (const bow_candidate_t& c : m.candidates) {
    answer.proposals.push_back(
        {c.session, SubmapId(c.submap), KeyframeId(c.keyframe), c.group_score, c.score, c.common_words});
  }
  return answer;
}

fetch_t ToMessage(const FetchRequest& request) {
  auto message = AboutSession<fetch_t>(request);
  message.first_seq = request.first_seq;
  message.last_seq = request.last_seq;
  message.max_bytes = request.max_bytes;
  return message;
}

FetchRequest Read(const fetch_t& m) {
  auto request = AddressedAs<FetchRequest>(m);
  request.session = m.session;
  request.first_seq = m.first_seq;
  request.last_seq = m.last_seq;
  request.max_bytes = m.max_bytes;
  return request;
}

fetched_t ToMessage(const FetchAnswer& answer) {
  auto message = AboutSession<fetched_t>(answer);
  message.status = static_cast<int8_t>(answer.status);
  message.cumulative = answer.cumulative;
  message.ended = answer.ended ? 1 : 0;
  for (const EncodedRecord& record : answer.records) {
    message.seq.push_back(record.seq);
    message.channel.push_back(record.channel);
    message.size.push_back(Count(record.data));
    message.data.insert(message.data.end(), record.data.begin(), record.data.end());
  }
  message.num_records = Count(message.seq);
  message.num_bytes = Count(message.data);
  message.sessions = ToMessages(answer.sessions);
  message.num_sessions = Count(message.sessions);
  return message;
}

FetchAnswer Read(const fetched_t& m) {
  auto answer = AddressedAs<FetchAnswer>(m);
  answer.status = ReadStatus(m.status, FetchAnswer::Status::kBadRequest);
  answer.session = m.session;
  answer.cumulative = m.cumulative;
  answer.ended = m.ended != 0;
  int64_t begin = 0;
  for (size_t i = 0; i < m.seq.size(); ++i) {
    const int64_t end = begin + m.size[i];
    Require(m.size[i] >= 0 && end <= m.num_bytes, "size of a record does not fit num_bytes");
    Require(i == 0 || m.seq[i] > m.seq[i - 1], "seq does not ascend");
    answer.records.push_back({m.session, m.seq[i], m.channel[i], {m.data.begin() + begin, m.data.begin() + end}});
    begin = end;
  }
  Require(begin == m.num_bytes, "num_bytes is not the records' size");
  answer.sessions = Read(m.sessions);
  return answer;
}

progress_request_t ToMessage(const ProgressRequest& request) { return AboutSession<progress_request_t>(request); }

ProgressRequest Read(const progress_request_t& m) {
  auto request = AddressedAs<ProgressRequest>(m);
  request.session = m.session;
  return request;
}

progress_t ToMessage(const SessionProgress& progress) {
  auto message = AboutSession<progress_t>(progress);
  message.status = static_cast<int8_t>(progress.status);
  message.cumulative = progress.cumulative;
  message.ended = progress.ended ? 1 : 0;
  message.next_submap = progress.next_submap;
  message.next_keyframe = progress.next_keyframe;
  message.next_point = progress.next_point;
  message.open_submap = progress.open_submap.value;
  message.last_frame = progress.last_frame;
  message.last_utime = progress.last_utime;
  return message;
}

SessionProgress Read(const progress_t& m) {
  auto progress = AddressedAs<SessionProgress>(m);
  progress.status = ReadStatus(m.status, SessionProgress::Status::kUnknownSession);
  progress.session = m.session;
  progress.cumulative = m.cumulative;
  progress.ended = m.ended != 0;
  progress.next_submap = m.next_submap;
  progress.next_keyframe = m.next_keyframe;
  progress.next_point = m.next_point;
  progress.open_submap = SubmapId(m.open_submap);
  progress.last_frame = m.last_frame;
  progress.last_utime = m.last_utime;
  return progress;
}

close_session_t ToMessage(const CloseRequest& request) { return AboutSession<close_session_t>(request); }

CloseRequest Read(const close_session_t& m) {
  auto request = AddressedAs<CloseRequest>(m);
  request.session = m.session;
  return request;
}

session_closed_t ToMessage(const CloseAnswer& answer) {
  auto message = AboutSession<session_closed_t>(answer);
  message.status = static_cast<int8_t>(answer.status);
  message.cumulative = answer.cumulative;
  return message;
}

CloseAnswer Read(const session_closed_t& m) {
  auto answer = AddressedAs<CloseAnswer>(m);
  answer.status = ReadStatus(m.status, CloseAnswer::Status::kStillAlive);
  answer.session = m.session;
  answer.cumulative = m.cumulative;
  return answer;
}

}  // namespace

template <>
std::vector<uint8_t> Encode(const BowQuery& query) {
  return EncodeMessage(ToMessage(query));
}

template <>
Decoded<BowQuery> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<BowQuery, bow_query_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const BowAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<BowAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<BowAnswer, bow_result_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const FetchRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<FetchRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<FetchRequest, fetch_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const FetchAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<FetchAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<FetchAnswer, fetched_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ProgressRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<ProgressRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ProgressRequest, progress_request_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const SessionProgress& progress) {
  return EncodeMessage(ToMessage(progress));
}

template <>
Decoded<SessionProgress> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<SessionProgress, progress_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const CloseRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<CloseRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<CloseRequest, close_session_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const CloseAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<CloseAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<CloseAnswer, session_closed_t>(data, size, Read);
}

}  // namespace mapmend

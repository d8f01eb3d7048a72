#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/stream/ids.h"
#include "libs/stream/records.h"
#include "libs/stream/revision.h"
#include "libs/stream/stream_cursor.h"

// What the store is asked, and what it answers (lcmtypes/*.lcm and libs/wire/query_codec.h have the wire form). Session
// names and ids in a question may be anything: whoever can reach the bus can ask.
namespace mapmend {

// Which question of whom: chosen by the one who asks, repeated in the answer.
struct Addressed {
  int64_t id = 0;
  std::string requester;
  bool operator==(const Addressed&) const = default;
};

// Which keyframes may see what this one sees? (paper section 3.3)
struct BowQuestion {
  std::string session;
  KeyframeId keyframe;
  std::vector<StreamCursor> cursors;  // answer as of exactly these records; a session not named is not searched
  int max_results = 20;
  bool same_submap = false;  // search the keyframe's own submap too, but not its covisible neighbours
  bool operator==(const BowQuestion&) const = default;
};
struct BowQuery : Addressed, BowQuestion {
  bool operator==(const BowQuery&) const = default;
};

struct BowProposal {
  std::string session;
  SubmapId submap;
  KeyframeId keyframe;
  float group_score = 0;  // summed over its covisible group
  float score = 0;        // L1 score of this keyframe
  int common_words = 0;
  bool operator==(const BowProposal&) const = default;
};

struct BowAnswer : Addressed {
  // kNotYet: not all records of the cursors are committed. kBadQuery: a cursor is missing or names no session.
  enum class Status { kOk, kNotYet, kUnknownKeyframe, kBadQuery };
  Status status = Status::kOk;
  std::string session;  // the keyframe that was asked about
  KeyframeId keyframe;
  KeyframeId adjacent;       // keyframe before it; none: invalid
  KeyframeId nearby;         // keyframe with overlap closest to 50 %; none: invalid
  int n0 = 0, n1 = 0;        // words shared with adjacent, with nearby
  float k = 0;               // n1 / n0 clamped, or its default
  float s0 = 0, s1 = 0;      // scores with adjacent, with nearby
  float l = 0;               // s1 / s0 clamped, or its default
  int max_common_words = 0;  // over all searched keyframes
  float best_group_score = 0;
  std::vector<BowProposal> proposals;  // best first; ties by session, then id
  bool operator==(const BowAnswer&) const = default;
};

// Committed records first_seq to last_seq. With an empty session: the list of sessions.
struct FetchRequest : Addressed {
  std::string session;
  int64_t first_seq = 0, last_seq = 0;  // inclusive
  int max_bytes = 0;                    // of one answer, bounded by the store; at least one record comes
  bool operator==(const FetchRequest&) const = default;
};
struct FetchAnswer : Addressed {
  enum class Status { kOk, kUnknownSession, kBadRequest };
  Status status = Status::kOk;
  std::string session;
  int64_t cumulative = -1;             // newest record committed without holes before it
  bool ended = false;                  // the session's last record is committed
  std::vector<EncodedRecord> records;  // of the session, ascending, as they were published
  std::vector<StreamCursor> sessions;  // answer to an empty session, oldest first
  bool operator==(const FetchAnswer&) const = default;
};

// How far has this session come? With the answer a frontend that was started again goes on in it: no id below the next
// ones may be used again.
struct ProgressRequest : Addressed {
  std::string session;
  bool operator==(const ProgressRequest&) const = default;
};
struct SessionProgress : Addressed {
  enum class Status { kOk, kUnknownSession };
  Status status = Status::kOk;
  std::string session;
  int64_t cumulative = 0;  // its last record
  bool ended = false;      // its end is committed
  int next_submap = 0, next_keyframe = 0;
  int next_point = 0;      // may leave ids out: those of points that were removed are in no table
  SubmapId open_submap;    // that has not ended; none: invalid
  int last_frame = -1;     // highest index of a frame in it; -1: none
  int64_t last_utime = 0;  // of the latest frame in it, or of its start
  bool operator==(const SessionProgress&) const = default;
};

// Ends a session whose frontend died without ending it, as if the frontend had.
struct CloseRequest : Addressed {
  std::string session;
  bool operator==(const CloseRequest&) const = default;
};
struct CloseAnswer : Addressed {
  enum class Status { kOk, kUnknownSession, kStillAlive };  // kStillAlive: its frontend sends heartbeats
  Status status = Status::kOk;
  std::string session;
  int64_t cumulative = 0;  // its last record
  bool operator==(const CloseAnswer&) const = default;
};

// Adds decisions to those of the map, or (with none) only asks for them. One that says what is in force is not added.
struct EdgeRequest : Addressed {
  std::vector<EdgeDecision> decisions;
  bool operator==(const EdgeRequest&) const = default;
};
struct EdgeAnswer : Addressed {
  std::vector<EdgeDecision> decisions;  // every one ever made, in order
  bool operator==(const EdgeAnswer&) const = default;
};

// One stored message of a revision (revision_codec.h).
struct RevisionRequest : Addressed {
  int64_t revision = -1;  // -1: the newest whose parts are all stored
  int part = -1;          // -1: the head
  bool operator==(const RevisionRequest&) const = default;
};
struct RevisionAnswer : Addressed {
  enum class Status { kOk, kNone };  // kNone: no such revision or part is stored, or it is damaged
  Status status = Status::kOk;
  int64_t revision = -1;
  int part = -1;
  int num_parts = 0;
  std::vector<uint8_t> data;  // as it was published
  bool operator==(const RevisionAnswer&) const = default;
};

// To the merger, after a head (part -1) or part was committed.
struct RevisionAck {
  int64_t revision = -1;
  int part = -1;
  bool operator==(const RevisionAck&) const = default;
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/geometry/same_bits.h"
#include "libs/stream/ids.h"

// What is said of the stream beside its records (libs/wire/stream_codec.h has the wire form).
namespace mapmend {

// Frontend to store, many times a second: shows gaps at the tail of the stream.
struct StreamState {
  std::string session;
  int64_t first = 0;  // oldest record the frontend can still send
  int64_t last = -1;  // newest record made, -1: none
  int64_t utime = 0;  // wall clock of sending; no decision depends on it
  bool ended = false;
  bool operator==(const StreamState&) const = default;
};

// Store to frontend, after commit and many times a second.
struct StreamAck {
  std::string session;
  int64_t cumulative = -1;       // every record up to and including this one is committed; -1: none
  std::vector<int64_t> missing;  // holes the store knows of, bounded
  std::string error;             // empty, or why nothing more is committed, e.g. "disk full"
  bool operator==(const StreamAck&) const = default;
};

// Store to frontend. Another number than before: what was on its way to the store before it may be lost.
struct StoreStarted {
  int64_t incarnation = 0;  // random, of this run of the store
  bool operator==(const StoreStarted&) const = default;
};

// CRC-32 of records first_seq, first_seq + 1, ... of a session (libs/base/checksum.h).
struct RecordChecksumList {
  std::string session;
  int64_t first_seq = 0;
  std::vector<uint32_t> crc32;
  bool operator==(const RecordChecksumList&) const = default;
};

// Where the frontend has the camera now. Best effort: no record.
struct FramePose {
  SubmapKey submap;  // id invalid: not tracked
  int64_t utime = 0;
  int frame = -1;
  std::string state;  // initialising, tracking, lost
  Rigid3 cam_from_submap;
  int num_inliers = 0;
  bool operator==(const FramePose&) const = default;
};

}  // namespace mapmend

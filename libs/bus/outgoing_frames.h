#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <vector>

#include "libs/base/range.h"

namespace mapmend {

struct OutgoingLimits {
  int64_t best_effort_bytes = 8 << 20;  // beyond it the oldest of them are dropped
  int64_t reliable_bytes = 16 << 20;    // beyond it nothing more is taken

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("best_effort_bytes", best_effort_bytes, Range(1, 1e12), "bytes");
    v("reliable_bytes", reliable_bytes, Range(1, 1e12), "bytes");
  }
};

// What waits to be sent over one connection. Not thread-safe.
class OutgoingFrames {
 public:
  explicit OutgoingFrames(const OutgoingLimits& limits) : limits_(limits) {}

  // kControl is always taken and goes out before all that waits.
  enum class Kind { kReliable, kBestEffort, kControl };
  bool Push(std::vector<uint8_t> frame, Kind kind);
  // Sends as much as the socket takes without waiting. False: the connection is over (errno says why).
  bool Write(int fd);
  bool Empty() const { return frames_.empty(); }
  void Clear();

 private:
  struct Frame {
    std::vector<uint8_t> bytes;
    Kind kind;
  };
  int64_t* Bytes(Kind kind) { return kind == Kind::kBestEffort ? &best_effort_bytes_ : &reliable_bytes_; }
  void DropOldestBestEffort();

  OutgoingLimits limits_;
  std::deque<Frame> frames_;
  size_t sent_of_front_ = 0;
  int num_control_ = 0;  // at the front, behind a frame that is partly sent
  int64_t best_effort_bytes_ = 0, reliable_bytes_ = 0;
};

}  // namespace mapmend

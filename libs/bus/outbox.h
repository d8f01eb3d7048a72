#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "libs/bus/codec.h"

namespace mapmend {

// The file that holds records until the store has committed them, so that a killed frontend loses nothing it has made.
// Append only, each entry with a checksum; a torn entry at the end (killed while writing) is cut off when the file is
// opened again. Bounded by what is not acknowledged: when all is, only the last number is left. With an empty path, or
// when the disk is full, entries are kept in memory. Not thread-safe.
class Outbox {
 public:
  // Opens or creates the file. Throws std::runtime_error with one line if it cannot be written, is in use by another
  // process, or is no outbox (then it is left as it was).
  explicit Outbox(const std::string& path);
  ~Outbox();
  Outbox(const Outbox&) = delete;
  Outbox& operator=(const Outbox&) = delete;

  void Append(EncodedRecord record);
  // Forgets the oldest entries up to and including seq.
  void Acknowledge(int64_t seq);

  bool Empty() const { return entries_.empty(); }
  int Size() const { return static_cast<int>(entries_.size()); }
  int64_t FirstSeq() const { return entries_.front().seq; }
  int64_t LastSeq() const { return last_seq_; }            // that was ever appended; -1: none
  const std::string& Session() const { return session_; }  // of its records, also if all are acknowledged; empty: none
  // The entry with this seq, or nullopt if it is not held or no longer readable.
  std::optional<EncodedRecord> Read(int64_t seq) const;
  int64_t FileBytes() const { return end_; }

 private:
  struct Entry {
    int64_t seq = -1;
    int64_t offset = -1;  // in the file; -1: in memory
    int64_t size = 0;
    std::optional<EncodedRecord> in_memory;
  };
  void Load();
  void LeaveOnlyTheNumber();
  void Compact();

  std::string path_, session_;
  int fd_ = -1;
  int64_t last_seq_ = -1;
  int64_t begin_ = 0, end_ = 0;  // bytes of the file before the first entry that is held, and in all
  std::deque<Entry> entries_;
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "libs/wire/codec.h"

namespace mapmend {

// The file that holds records until the store has committed them, so that a killed frontend loses nothing it has made.
// Append only, each entry with a checksum; what is damaged is left out when the file is opened again (torn by a kill or
// a power cut), so there may be holes in the numbers. Bounded by what is not acknowledged: when all is, only the last
// number is left. With an empty path, or when the disk is full, entries are kept in memory, up to a limit: then the
// oldest of them are given up. Not thread-safe.
class Outbox {
 public:
  // Opens or creates the file. Throws std::runtime_error with one line if it cannot be written, is in use by another
  // process, or is no outbox (then it is left as it was).
  explicit Outbox(const std::string& path, int64_t max_memory_bytes = 512 << 20);
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
  // The oldest that is held with a seq greater than this; -1: none.
  int64_t NextSeq(int64_t seq) const;
  // Forgets one that cannot be read.
  void GiveUp(int64_t seq);
  // Has the disk keep what was appended, also if the power fails. Waits for the disk if there is something to keep.
  void Sync();
  int64_t FileBytes() const { return end_; }

 private:
  struct Entry {
    int64_t seq = -1;
    int64_t offset = -1;  // in the file; -1: in memory
    int64_t size = 0;
    std::optional<EncodedRecord> in_memory;
  };
  using Entries = std::deque<Entry>;
  void Load();
  bool WriteToFile(const EncodedRecord& record, Entry* entry);
  void KeepInMemory(EncodedRecord record, Entry* entry);
  int64_t FindEntry(int64_t offset, int64_t file_size) const;
  Entries::const_iterator At(int64_t seq) const;
  void LeaveOnlyTheNumber();
  void Compact();

  std::string path_, session_;
  int fd_ = -1;
  int64_t last_seq_ = -1;
  int64_t begin_ = 0, end_ = 0;  // bytes of the file before the first entry that is held, and in all
  Entries entries_;              // seq grows
  int64_t memory_bytes_ = 0, max_memory_bytes_;
  bool is_dirty_ = false, disk_fails_ = false, has_given_up_ = false;
};

}  // namespace mapmend

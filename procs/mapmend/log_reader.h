#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libs/bus/codec.h"
#include "libs/mapping/ids.h"

namespace lcm {
class LogFile;
}

namespace mapmend {

// The stream out of a recording by lcm-logger: the records of every session once and in seq order, whatever was
// recorded twice, out of order or besides (acks, health, what other processes derived). Needs no bus.
//
// A session that the recording does not show to its end (the recorder was stopped, or a record is missing) is closed:
// the submap that is open is ended, then the session, with records made here, so that it can be mapped up to there.
class LogReader {
 public:
  // Throws std::runtime_error naming the file if it cannot be read, is no LCM log or holds no session of mapmend.
  explicit LogReader(const std::string& path);
  ~LogReader();

  // The next record; nullopt at the end.
  std::optional<EncodedRecord> Next();

  // Of the first session: what its frontend used.
  const std::string& VocabularyHash() const { return vocabulary_hash_; }
  // After the end: one line per session that is not complete, and what was refused; empty if all is well.
  const std::vector<std::string>& Complaints() const { return complaints_; }
  // Each session's last record so far.
  std::map<std::string, int64_t> LastRecords() const;

 private:
  struct Session {
    int64_t next_seq = 0;
    std::map<int64_t, EncodedRecord> early;  // recorded before a record that precedes them
    SubmapId open_submap;
    int last_frame = -1;
    int64_t last_utime = 0;
    bool ended = false;
  };

  bool ReadEvent();  // one event of the file into ready_ or early; false at the end of the file
  void Deliver(const EncodedRecord& encoded, const Record& record, Session* session);
  void CloseIncomplete();

  std::string path_;
  std::unique_ptr<lcm::LogFile> log_;
  std::map<std::string, Session> sessions_;
  std::deque<EncodedRecord> ready_;
  std::vector<std::string> complaints_;
  std::string vocabulary_hash_;
  int num_refused_ = 0;
  std::string first_refusal_;
  bool at_end_ = false;
};

}  // namespace mapmend

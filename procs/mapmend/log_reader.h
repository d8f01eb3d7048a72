#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/bus/recording_file.h"
#include "libs/stream/ids.h"
#include "libs/wire/codec.h"

namespace mapmend {

// The stream out of one recording by lcm-logger, in any number of files: the sound records of every session once and in
// seq order, whatever was recorded twice, out of order or besides (acks, health, what other processes derived). Needs
// no bus. The files are read twice: first to know what they hold, then record by record.
//
// A record is sound if its checksum (MAPMEND_CHECKSUM) fits; in a recording without checksums, if it decodes. Behind a
// record that is missing or damaged, the submap that is open is ended, and the stream goes on with the next one. A
// session that the recording does not show to its end is closed. The records that do so are made here.
class LogReader {
 public:
  // Throws std::runtime_error naming the file if it cannot be read, is no LCM log or holds no session of mapmend.
  explicit LogReader(const std::vector<std::string>& paths);
  explicit LogReader(const std::string& path) : LogReader(std::vector<std::string>{path}) {}

  // The next record; nullopt at the end.
  std::optional<EncodedRecord> Next();

  // Of the first session: what its frontend used.
  const std::string& VocabularyHash() const { return vocabulary_hash_; }
  // False: of an older program, damage is seen only where a record does not decode.
  bool HasChecksums() const { return !files_with_checksums_.empty(); }
  // After the end: what is damaged or not complete, a line each; empty if all is well.
  const std::vector<std::string>& Complaints() const { return complaints_; }
  // Records that Next will still give; a few more where it closes what the recording leaves open.
  int64_t NumLeft() const;
  // Each session's last record so far.
  std::map<std::string, int64_t> LastRecords() const;

 private:
  struct Place {
    int file = 0;
    int64_t offset = 0;
    auto operator<=>(const Place&) const = default;
  };
  struct Candidate {  // one recorded message
    Place place;
    uint32_t checksum = 0;
    const char* channel = nullptr;
    bool decodes = false;
  };
  struct Session {
    std::map<int64_t, std::vector<Candidate>> recorded;
    std::map<int64_t, std::vector<uint32_t>> checksums;
    std::map<int64_t, Candidate> sound;  // what will be given
    int64_t next_seq = 0;
    SubmapId open_submap;
    bool is_skipping = false;  // up to the next submap
    int64_t num_skipped = 0;
    SessionStarted start;  // once it has been given
    int first_frame = -1, last_frame = -1;
    int64_t last_utime = 0;
    bool ended = false;
  };

  void ReadFile(int file);
  void OnRecord(const LoggedEvent& event, const char* channel, int file);
  void OnChecksums(const LoggedEvent& event, int file);
  void Choose(const std::string& id, Session* session);
  bool Advance();  // one record of one session into ready_; false if all are given
  void OnHole(const std::string& id, int64_t next_sound, Session* session);
  void Deliver(EncodedRecord encoded, const Record& record, Session* session);
  static void NoteFrame(int frame, Session* session);
  void Close(const std::string& id, Session* session);
  void CloseSubmap(const std::string& id, Session* session, const std::string& reason, const std::string& detail);
  void ComplainOfFiles();

  std::vector<std::unique_ptr<RecordingFile>> files_;
  std::map<std::string, Session> sessions_;
  std::deque<EncodedRecord> ready_;
  std::vector<std::string> complaints_;
  std::string vocabulary_hash_;
  std::set<int> files_with_checksums_;
  int num_refused_ = 0;
  std::string first_refusal_;
  bool at_end_ = false;
};

}  // namespace mapmend

#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "libs/wire/codec.h"
#include "procs/submap_store/file_guard.h"

namespace mapmend {

// A session as the file has it.
struct SessionRow {
  int64_t id = 0;  // 1, 2, ... in the order in which sessions came
  std::string uuid, vehicle, source, vocabulary_hash;
  int64_t start_utime = 0;
  bool ended = false, is_derived = false;
  int64_t cumulative = -1;  // last record, or last record of a gap
  std::string settings;     // JSON
};

struct GapRow {
  int64_t session = 0, first_seq = 0, last_seq = 0;
  std::string reason;
};

// The database's file is no longer where it was opened. The process must end; if can_go_on, a new one finds all that
// was committed under the old name.
struct FileGone : std::runtime_error {
  FileGone(const std::string& what, bool restored) : std::runtime_error(what), can_go_on(restored) {}
  bool can_go_on;
};

// One open map database: the file, its locks and its prepared statements. Write-ahead log, synchronous FULL. One
// thread.
class Database {
 public:
  enum class Mode {
    kReadWrite,
    kReadOnly,
    kScratch,  // empty, of the newest schema, in a file that SQLite makes and removes; the path is not used
    kDamaged,  // read only, whatever the file's header says; for older schemas too
  };

  // Throws std::runtime_error with one line if the file cannot be used (FileGuard), SQLite::Exception if SQLite fails.
  // kReadWrite creates and migrates. kReadOnly refuses older schemas: only a writer migrates.
  Database(const std::string& path, Mode mode);

  const std::string& Path() const { return path_; }
  // Throws FileGone if the file has been removed or replaced since it was opened. What was in it is then written anew:
  // under its name if that is free, else under its name + ".rescued".
  void CheckPlace();
  SQLite::Database& Sql() { return *sql_; }
  bool HasChecksums() const { return has_checksums_; }  // not in an older schema

  // Calls hook after each commit of this connection.
  void SetCommitHook(std::function<void()> hook);

  // A prepared statement, made once; reset when the Use goes, so that no read transaction stays open.
  class Use {
   public:
    explicit Use(SQLite::Statement* statement) : statement_(statement) {}
    ~Use() {
      statement_->tryReset();
      statement_->clearBindings();
    }
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    SQLite::Statement* operator->() { return statement_; }
    SQLite::Statement* get() { return statement_; }

   private:
    SQLite::Statement* statement_;
  };
  Use Prepare(const std::string& sql);

  std::vector<SessionRow> Sessions();
  std::vector<GapRow> Gaps(int64_t session);
  // Calls visit for the sound records first .. last of a session in order, until it returns false. One that its
  // checksum, its header or SQLite tells to be damaged is left out, and on_damaged called for it.
  using OnDamaged = std::function<void(int64_t seq, const std::string& channel, const std::string& what)>;
  void ReadRecords(const SessionRow& session, int64_t first, int64_t last,
                   const std::function<bool(EncodedRecord)>& visit, const OnDamaged& on_damaged = {});
  // The row's payload, or nullopt.
  std::optional<std::vector<uint8_t>> ReadPayload(int64_t session, int64_t seq);

 private:
  std::string path_;
  std::unique_ptr<FileGuard> guard_;  // none in scratch
  bool has_checksums_ = true;
  std::unique_ptr<SQLite::Database> sql_;
  std::function<void()> commit_hook_;
  std::map<std::string, std::unique_ptr<SQLite::Statement>> statements_;
};

// Whether the file, not the disk or another program, is the reason.
bool IsDamage(const SQLite::Exception& e);

}  // namespace mapmend

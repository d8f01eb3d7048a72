#include "procs/submap_store/checkpointer.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>

namespace mapmend {
namespace {

// The log can begin anew only when all of it is in the file. Under steady writing a passive checkpoint may never be
// that far: beyond this size one commit has to wait for it.
constexpr uintmax_t kMaxWalBytes = 32 << 20;
constexpr int kCheckpointTimeoutMs = 1000;
constexpr auto kMaxWait = std::chrono::seconds(1);  // for a commit to begin after

void Checkpoint(SQLite::Database* database, const std::string& path) {
  // Busy or out of room: what is committed is safe in the log, the next one will do.
  database->tryExec("PRAGMA wal_checkpoint(PASSIVE)");
  std::error_code ignored;
  const uintmax_t wal_bytes = std::filesystem::file_size(path + "-wal", ignored);
  if (!ignored && wal_bytes > kMaxWalBytes) database->tryExec("PRAGMA wal_checkpoint(TRUNCATE)");
}

}  // namespace

Checkpointer::Checkpointer(const std::string& path, int interval_ms)
    : thread_([this, path, interval_ms] { Run(path, interval_ms); }) {}

Checkpointer::~Checkpointer() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void Checkpointer::OnCommit() {
  {
    const std::lock_guard lock(mutex_);
    is_dirty_ = is_fresh_ = true;
  }
  wake_.notify_one();
}

void Checkpointer::Run(const std::string& path, int interval_ms) {
  try {
    SQLite::Database database(path, SQLite::OPEN_READWRITE, kCheckpointTimeoutMs);
    database.exec("PRAGMA wal_autocheckpoint = 0");
    database.exec("PRAGMA synchronous = FULL");
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [this] { return stop_ || is_dirty_; });
      wake_.wait_for(lock, kMaxWait, [this] { return stop_ || is_fresh_; });
      if (stop_) return;
      is_dirty_ = false;
      lock.unlock();
      Checkpoint(&database, path);
      lock.lock();
      wake_.wait_for(lock, std::chrono::milliseconds(interval_ms), [this] { return stop_; });
      is_fresh_ = false;
    }
  } catch (const std::exception& e) {
    spdlog::error("checkpoints of {}: {}", path, e.what());
  }
}

}  // namespace mapmend

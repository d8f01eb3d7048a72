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
constexpr int kBusyTimeoutMs = 1000;

}  // namespace

Checkpointer::Checkpointer(const std::string& path, int interval_ms) {
  thread_ = std::thread([this, path, interval_ms] {
    try {
      SQLite::Database database(path, SQLite::OPEN_READWRITE, kBusyTimeoutMs);
      database.exec("PRAGMA wal_autocheckpoint = 0");
      database.exec("PRAGMA synchronous = FULL");
      auto next = std::chrono::steady_clock::now();
      while (!stop_) {
        if (std::chrono::steady_clock::now() >= next) {
          // Busy or out of room: what is committed is safe in the log, the next one will do.
          std::error_code ignored;
          const uintmax_t wal_bytes = std::filesystem::file_size(path + "-wal", ignored);
          const bool is_large = !ignored && wal_bytes > kMaxWalBytes;
          database.tryExec(is_large ? "PRAGMA wal_checkpoint(TRUNCATE)" : "PRAGMA wal_checkpoint(PASSIVE)");
          next = std::chrono::steady_clock::now() + std::chrono::milliseconds(interval_ms);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
    } catch (const std::exception& e) {
      spdlog::error("checkpoints of {}: {}", path, e.what());
    }
  });
}

Checkpointer::~Checkpointer() {
  stop_ = true;
  thread_.join();
}

}  // namespace mapmend

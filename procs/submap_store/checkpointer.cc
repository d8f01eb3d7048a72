#include "procs/submap_store/checkpointer.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <spdlog/spdlog.h>

#include <chrono>

namespace mapmend {

Checkpointer::Checkpointer(const std::string& path, int interval_ms) {
  thread_ = std::thread([this, path, interval_ms] {
    try {
      SQLite::Database database(path, SQLite::OPEN_READWRITE);
      database.exec("PRAGMA wal_autocheckpoint = 0");
      database.exec("PRAGMA synchronous = FULL");
      auto next = std::chrono::steady_clock::now();
      while (!stop_) {
        if (std::chrono::steady_clock::now() >= next) {
          // Busy or out of room: what is committed is safe in the log, the next one will do.
          database.tryExec("PRAGMA wal_checkpoint(PASSIVE)");
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

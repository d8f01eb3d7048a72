#pragma once

#include <atomic>
#include <string>
#include <thread>

namespace mapmend {

// Moves what is committed from the write-ahead log into the database file, from a connection and a thread of its own: a
// commit that has to do it takes up to half a second, with this its 99th percentile is a few milliseconds. PASSIVE, so
// that the writer need not wait, unless the log has grown beyond 32 MB.
class Checkpointer {
 public:
  // The file must be open elsewhere for as long as this lives (FileGuard).
  explicit Checkpointer(const std::string& path, int interval_ms = 200);
  ~Checkpointer();
  Checkpointer(const Checkpointer&) = delete;
  Checkpointer& operator=(const Checkpointer&) = delete;

 private:
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace mapmend

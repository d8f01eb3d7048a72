#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace mapmend {

// Moves what is committed from the write-ahead log into the database file, from a connection and a thread of its own: a
// commit that has to do it takes up to half a second. A checkpoint waits for the disk, and a commit beside it waits
// longer: so it begins just after a commit, when the next is farthest away. PASSIVE, so that the writer need not wait,
// unless the log has grown beyond 32 MB.
class Checkpointer {
 public:
  // The file must be open elsewhere for as long as this lives (FileGuard). Checkpoints come interval_ms apart or more.
  explicit Checkpointer(const std::string& path, int interval_ms = 200);
  ~Checkpointer();
  Checkpointer(const Checkpointer&) = delete;
  Checkpointer& operator=(const Checkpointer&) = delete;

  // To be called after each commit.
  void OnCommit();

 private:
  void Run(const std::string& path, int interval_ms);

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  bool is_dirty_ = false;  // something was committed since the last checkpoint began
  bool is_fresh_ = false;  // and just now
  std::thread thread_;
};

}  // namespace mapmend

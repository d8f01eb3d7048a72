#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

namespace mapmend {

// Flights of which the station has not had everything: outboxes in FOLDER/undelivered/. Delivers them, and has their
// sessions closed, in a thread of its own with a connection of its own, so that a new flight need not wait for the old
// ones.
class Undelivered {
 public:
  // Moves OUT/outbox, if an earlier flight has left one with something in it, to the others.
  // Throws std::runtime_error with one line if that is no outbox, or cannot be moved.
  Undelivered(const std::string& out, const std::string& lcm_url, const std::string& channel_prefix);
  ~Undelivered();

  // Flights that wait. Thread-safe.
  int NumWaiting() const { return num_waiting_; }

 private:
  void Run();

  const std::string folder_, lcm_url_, channel_prefix_;
  std::atomic<int> num_waiting_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace mapmend

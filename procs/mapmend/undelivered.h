#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

namespace mapmend {

class Bus;
class StoreClient;

// Flights of which the station has not had everything: outboxes in FOLDER/undelivered/. Delivers them, and has their
// sessions closed, in a thread of its own with a connection of its own, so that a new flight need not wait for the old
// ones.
class Undelivered {
 public:
  // Moves OUT/outbox, if an earlier flight has left one with something in it, to the others.
  // flying: the session of the flight that now begins. If a file is flown again under its old session, the frontend
  // sends the same records once more; what the earlier flight left waits for EndFlight(), and then little of it is new.
  // Throws std::runtime_error with one line if OUT/outbox is no outbox, or cannot be moved.
  Undelivered(const std::string& out, const std::string& lcm_url, const std::string& channel_prefix,
              const std::string& flying);
  ~Undelivered();
  // The flight has ended: what an earlier one of its session left is delivered too.
  void EndFlight() { is_flying_ = false; }

  // Flights that wait. Thread-safe.
  int NumWaiting() const { return num_waiting_; }

 private:
  void Run();
  // Whether all of an outbox has been delivered and its session is closed.
  bool Deliver(Bus* bus, StoreClient* store, const std::string& path) const;

  const std::string folder_, lcm_url_, channel_prefix_, flying_;
  std::atomic<bool> is_flying_{true};
  std::atomic<int> num_waiting_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace mapmend

#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/positioning/position_source.h"

namespace mapmend {

// Positions that a receiver publishes on the bus while the camera flies. A connection and a thread of its own, so that
// nobody waits for them.
class LivePositions {
 public:
  LivePositions(const std::string& url, const std::string& channel_prefix);
  ~LivePositions();

  // What has come since the last call, in order.
  std::vector<PositionFix> Take();
  int64_t NumBad() const { return num_bad_ + bus_.NumRefused(); }

 private:
  Bus bus_;
  std::mutex mutex_;
  std::vector<PositionFix> waiting_;
  FixFilter filter_;
  std::atomic<int64_t> num_bad_{0};
  std::atomic<bool> stop_{false};
  Subscription subscription_;
  std::thread thread_;
};

// Positions of one flight as its frames come: from a file, or live.
class PositionInput {
 public:
  // live: null for files.
  PositionInput(PositionSource source, std::unique_ptr<LivePositions> live)
      : source_(std::move(source)), live_(std::move(live)) {}

  // Those to be told with this frame.
  std::vector<PositionFix> TakeFor(int frame, int64_t utime);
  // Those that are left when the flight has ended.
  std::vector<PositionFix> TakeRest();
  // An earlier frontend has told those up to this time.
  void PassOver(int64_t utime);
  int64_t NumTold() const { return num_told_; }
  int64_t NumBad() const { return live_ ? live_->NumBad() : 0; }

 private:
  std::vector<PositionFix> Count(std::vector<PositionFix> fixes);

  PositionSource source_;
  std::unique_ptr<LivePositions> live_;
  int64_t num_told_ = 0;
};

}  // namespace mapmend

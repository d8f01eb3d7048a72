#include "procs/frontend/position_input.h"

#include <utility>

#include "libs/bus/channels.h"
#include "libs/wire/stream_codec.h"

namespace mapmend {

LivePositions::LivePositions(const std::string& url, const std::string& channel_prefix) : bus_(url, channel_prefix) {
  subscription_ = bus_.Subscribe<PositionFix>(channels::kGps, Delivery::kKeepAll, [this](const PositionFix& fix) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (filter_.Add(fix).empty()) {
      waiting_.push_back(fix);
    } else {
      ++num_bad_;
    }
  });
  thread_ = std::thread([this] {
    while (!stop_) bus_.Handle(50);
  });
}

LivePositions::~LivePositions() {
  stop_ = true;
  thread_.join();
}

std::vector<PositionFix> LivePositions::Take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(waiting_, {});
}

std::vector<PositionFix> PositionInput::Count(std::vector<PositionFix> fixes) {
  num_told_ += static_cast<int64_t>(fixes.size());
  return fixes;
}

std::vector<PositionFix> PositionInput::TakeFor(int frame, int64_t utime) {
  return Count(live_ ? live_->Take() : source_.TakeFor(frame, utime));
}

std::vector<PositionFix> PositionInput::TakeRest() { return Count(live_ ? live_->Take() : source_.TakeRest()); }

void PositionInput::PassOver(int64_t utime) { source_.PassOver(utime); }

}  // namespace mapmend

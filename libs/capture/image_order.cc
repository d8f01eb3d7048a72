#include "libs/capture/image_order.h"

#include <algorithm>

namespace mapmend {
namespace {

constexpr int kConfirming = 3;             // images in a row that make a new order
constexpr int64_t kMaxLeapUs = 10000000;   // ahead, whenever the image comes
constexpr int64_t kMaxLeapOfArrival = 20;  // times as much as has passed since: a file may be played faster
constexpr int kMaxIndex = 1 << 30;         // of the protocol
constexpr int64_t kOfLate = 30;            // images
constexpr size_t kManyStrays = 6;          // of them: not chance, but another sender

std::string Seconds(int64_t us) {
  const int64_t tenths = (us < 0 ? -us : us) / 100000;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

}  // namespace

std::string ImageOrder::WhyNotAfter(const Image& a, const Image& b) const {
  if (b.utime <= a.utime) return "time does not grow";
  const int64_t passed = std::max<int64_t>(b.arrival_us - a.arrival_us, 0);
  if (b.utime - a.utime > kMaxLeapUs + kMaxLeapOfArrival * passed)
    return "time leaps ahead by " + Seconds(b.utime - a.utime);
  if (is_numbered_ && b.frame <= a.frame) return "number " + std::to_string(b.frame) + " does not grow";
  return {};
}

void ImageOrder::Take(const Image& image, Decision* decision) {
  if (last_ && image.frame > last_->frame) is_numbered_ = true;
  last_utime_ = image.utime + offset_us_;
  last_index_ = image.frame > last_index_ && image.frame < kMaxIndex ? image.frame : last_index_ + 1;
  decision->good.push_back({image.id, last_index_, last_utime_});
  last_ = image;
}

void ImageOrder::TakeHeld(Decision* decision) {
  const Image& first = held_.front();
  const int64_t leap = first.utime - last_->utime;
  const int64_t passed = std::max<int64_t>(first.arrival_us - last_->arrival_us, 1000);
  if (leap <= 0) {
    decision->event = "the camera's clock went back by " + Seconds(leap) + ": times go on from the last image";
  } else if (leap > kMaxLeapUs + kMaxLeapOfArrival * passed) {
    decision->event = "the camera's clock leapt ahead by " + Seconds(leap);
  }
  // The camera's own time again as soon as that grows.
  if (first.utime > last_utime_) {
    offset_us_ = 0;
  } else if (first.utime + offset_us_ <= last_utime_) {
    offset_us_ = last_utime_ + passed - first.utime;
  }
  is_numbered_ = false;  // whoever begins anew may not count any more
  for (const Image& image : held_) Take(image, decision);
  held_.clear();
  strays_of_late_.clear();
}

ImageOrder::Decision ImageOrder::Add(int64_t utime, int frame, int64_t arrival_us) {
  Decision decision;
  const Image image{next_id_++, utime, arrival_us, frame};
  decision.id = image.id;
  const auto refuse_held = [&] {
    for (const Image& stray : held_) {
      decision.strays.push_back(stray.id);
      strays_of_late_.push_back(stray.id);
    }
    held_.clear();
  };
  if (!last_) {
    Take(image, &decision);
    return decision;
  }
  const std::string why = WhyNotAfter(*last_, image);
  if (why.empty()) {
    const bool had_strays = !held_.empty();
    refuse_held();
    Take(image, &decision);
    std::erase_if(strays_of_late_, [&](int64_t id) { return id < image.id - kOfLate; });
    if (had_strays && strays_of_late_.size() >= kManyStrays) {
      decision.event =
          "images of another camera come in between on the same channel; only those that follow the first "
          "ones are taken: give each camera a channel, or a --channel-prefix, of its own";
      strays_of_late_.clear();
    }
    return decision;
  }
  if (!held_.empty() && !WhyNotAfter(held_.back(), image).empty()) refuse_held();
  held_.push_back(image);
  if (static_cast<int>(held_.size()) == kConfirming) {
    TakeHeld(&decision);
  } else {
    decision.held_because = why;
  }
  return decision;
}

}  // namespace mapmend

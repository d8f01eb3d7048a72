#include "procs/frontend/live_images.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>

#include "libs/bus/channels.h"
#include "procs/frontend/image_message.h"

namespace mapmend {
namespace {

constexpr int kMaxIndex = 1 << 30;  // of the protocol

}  // namespace

LiveImages::LiveImages(const std::string& url, const std::string& channel_prefix, int width, int height,
                       int max_waiting)
    : width_(width), height_(height), bus_(url, channel_prefix), queue_(static_cast<size_t>(max_waiting)) {
  subscription_ = bus_.Subscribe<image_t>(channels::kImage, Delivery::kLatest,
                                          [this](const image_t& message) { Receive(message); });
  thread_ = std::thread([this] {
    while (!stop_) bus_.Handle(50);
  });
}

LiveImages::~LiveImages() {
  Stop();
  thread_.join();
}

void LiveImages::Receive(const image_t& message) {
  if (IsEndOfStream(message)) {
    queue_.Close();
    return;
  }
  if (const std::string problem = ImageProblem(message, width_, height_, last_utime_); !problem.empty()) {
    Refuse(problem);
    return;
  }
  last_utime_ = message.utime;
  // The camera's own number as long as it grows; a camera that was started again is counted on from here.
  last_index_ = message.frame > last_index_ && message.frame < kMaxIndex ? message.frame : last_index_ + 1;
  queue_.Push({last_index_, std::make_shared<image_t>(message)});
}

void LiveImages::Refuse(const std::string& problem) {
  const int64_t count = ++num_bad_;
  if (count <= 10 || count % 1000 == 0) spdlog::warn("image refused ({} in all): {}", count, problem);
  const std::lock_guard lock(mutex_);
  last_problem_ = problem;
}

std::optional<SourceImage> LiveImages::Next() {
  while (auto arrival = queue_.Pop()) {
    if (auto pixels = DecodeImage(*arrival->message))
      return SourceImage{arrival->index, arrival->message->utime, std::move(pixels)};
    Refuse("the JPEG is damaged");
  }
  return std::nullopt;
}

void LiveImages::Stop() {
  stop_ = true;
  queue_.Clear();
}

std::string LiveImages::LastProblem() const {
  const std::lock_guard lock(mutex_);
  return last_problem_;
}

}  // namespace mapmend

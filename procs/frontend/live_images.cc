#include "procs/frontend/live_images.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <mapmend/image_t.hpp>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>

#include "libs/image_messages/image_message.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

int64_t Microseconds(Clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}

}  // namespace

LiveImages::LiveImages(const std::string& url, const std::string& channel_prefix, const std::string& channel, int width,
                       int height, int max_waiting)
    : width_(width),
      height_(height),
      name_("channel " + channel_prefix + channel),
      bus_(url, channel_prefix),
      queue_(static_cast<size_t>(max_waiting)) {
  subscription_ =
      bus_.SubscribeRaw(channel, Delivery::kLatest, [this](const uint8_t* data, int size) { ReceiveRaw(data, size); });
  thread_ = std::thread([this] {
    while (!stop_) {
      bus_.Handle(50);
      if (ends_.HasEnded(Clock::now())) queue_.Close();
    }
  });
}

LiveImages::~LiveImages() {
  Stop();
  thread_.join();
}

void LiveImages::ReceiveRaw(const uint8_t* data, int size) {
  auto message = std::make_shared<image_t>();
  // The bus counts what is thrown here as refused.
  if (!DecodeImageMessage(data, size, message.get()))
    throw std::runtime_error("neither mapmend's image_t nor bot_core's");
  Receive(std::move(message));
}

void LiveImages::Receive(std::shared_ptr<image_t> message) {
  const auto now = Clock::now();
  if (IsEndOfStream(*message)) {
    ends_.Said(now);
    return;
  }
  if (const std::string problem = ImageProblem(*message, width_, height_); !problem.empty()) {
    Refuse(problem);
    return;
  }
  ends_.GoodImage();
  const ImageOrder::Decision decision = order_.Add(message->utime, message->frame, Microseconds(now));
  held_[decision.id] = std::move(message);
  num_held_ = order_.NumHeld();
  for (const int64_t stray : decision.strays) {
    Refuse("its time or number does not follow those of the images before and after it");
    held_.erase(stray);
  }
  for (const ImageOrder::Good& good : decision.good) {
    queue_.Push({good, held_.at(good.id)});
    held_.erase(good.id);
  }
  if (!decision.held_because.empty()) problems_.Suspect(decision.held_because);
  if (!decision.event.empty()) {
    problems_.Tell(decision.event);
    spdlog::warn("{}: {}", name_, decision.event);
  }
}

void LiveImages::Refuse(const std::string& problem) {
  const int64_t count = problems_.Add(problem);
  if (count <= 10 || count % 1000 == 0) spdlog::warn("image refused ({} in all): {}", count, problem);
}

std::optional<SourceImage> LiveImages::Next() {
  while (auto arrival = queue_.Pop()) {
    DecodedImage image = DecodeImage(*arrival->message);
    if (!image.pixels) {
      Refuse("the JPEG " + image.problem);
      continue;
    }
    SourceImage taken{arrival->place.index, arrival->place.utime, std::move(image.pixels)};
    // Not copied: they are the message's.
    if (arrival->message->format == image_t::JPEG) taken.jpeg = {arrival->message, &arrival->message->data};
    return taken;
  }
  return std::nullopt;
}

void LiveImages::Stop() {
  stop_ = true;
  queue_.Clear();
}

}  // namespace mapmend

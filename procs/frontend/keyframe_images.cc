#include "procs/frontend/keyframe_images.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <opencv2/core.hpp>
#include <thread>
#include <utility>

#include "libs/base/stop_request.h"
#include "libs/bus/bus.h"
#include "libs/bus/health.h"
#include "libs/wire/store_client.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kAskTimeoutMs = 3000;  // a store without images does not answer
constexpr auto kPatience = std::chrono::seconds(5);

}  // namespace

KeyframeImages::KeyframeImages(const RunOptions& options, const std::string& session)
    : url_(ResolveLcmUrl(options.process.lcm_url)),
      channel_prefix_(options.process.channel_prefix),
      session_(session),
      is_spool_kept_(!options.outbox_path.empty()) {
  const int width = KeptWidth(options.images, options.mode == InputMode::kLive);
  const std::string path = is_spool_kept_ ? SpoolPathFor(options.outbox_path) : "";
  try {
    file_ = std::make_unique<ImageFile>(path, ImageFile::Mode::kReadWrite);
  } catch (const std::exception& e) {
    spdlog::error("{}; no images are kept", e.what());
    file_ = std::make_unique<ImageFile>("", ImageFile::Mode::kReadWrite);
  }
  if (width != kNoImages) {
    spooler_ = std::make_unique<ImageSpooler>(file_.get(), options.images, width);
    waiting_ = std::make_unique<WaitingImages>(options.images, width, options.mode == InputMode::kLockstep);
  }
  ImageSenderOptions sender;
  sender.lcm_url = url_;
  sender.channel_prefix = channel_prefix_;
  sender.rate_kbit_s = options.images.rate_kbit_s >= 0 ? options.images.rate_kbit_s : DefaultImageRate(url_);
  sender.sessions = {session};
  if (!options.continues.empty()) sender.sessions.insert(options.continues);
  sender.is_pending = [this](const std::string& of, KeyframeId keyframe) {
    return spooler_ && (!has_passed_all_ || spooler_->IsPending(of, keyframe));
  };
  sender_ = std::make_unique<ImageSender>(file_.get(), sender);
}

KeyframeImages::~KeyframeImages() = default;

void KeyframeImages::Take(KeyframeId keyframe, int frame, int64_t utime, const OriginalImage& original) {
  if (original.IsNone()) return;
  spooler_->Push({session_, keyframe, frame, utime, original});
}

void KeyframeImages::LookForLost(const std::string& session, const std::string& continued) {
  if (!spooler_ || (session.empty() && continued.empty())) return;
  Bus bus(url_, channel_prefix_);
  StoreClient store(&bus, "frontend_images-" + std::to_string(getpid()));
  for (const std::string& asked : {session, continued}) {
    if (asked.empty()) continue;
    const auto status = store.AskImages(asked, kAskTimeoutMs);
    if (!status) continue;
    for (const auto& [keyframe, frame] : status->awaited) {
      const auto entry = file_->Find(asked, keyframe);
      if (entry && entry->frame == frame) continue;
      lost_.emplace(frame, Lost{asked, keyframe});
      spooler_->Expect(asked, keyframe);
    }
  }
  if (!lost_.empty()) spdlog::info("images of {} keyframes are taken from the input once more", lost_.size());
}

void KeyframeImages::OnPassed(const SourceImage& image) {
  const auto [begin, end] = lost_.equal_range(image.index);
  for (auto it = begin; it != end; ++it) {
    OriginalImage original{image.jpeg, image.jpeg ? nullptr : image.pixels, image.pixels->cols, image.pixels->rows};
    spooler_->Push({it->second.session, it->second.keyframe, image.index, image.utime, std::move(original)}, true);
  }
}

void KeyframeImages::PassedAll() {
  if (spooler_) spooler_->ExpectNoMore();
  has_passed_all_ = true;
}

void KeyframeImages::WaitUntilStored(HealthReporter* health) {
  auto last_progress = Clock::now();
  size_t before = 0;
  for (;;) {
    const size_t num_left = file_->List().size();
    if (num_left != std::exchange(before, num_left)) last_progress = Clock::now();
    if (num_left == 0 || StopRequested() || Clock::now() - last_progress > kPatience) return;
    health->SetState("busy", std::to_string(num_left) + " images are still to be stored");
    health->Tick();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

void KeyframeImages::Finish(HealthReporter* health) {
  if (!spooler_) return;
  PassedAll();
  spooler_->Flush();
  health->SetCounter("images_given_up", static_cast<double>(spooler_->NumGivenUp()));
  if (!is_spool_kept_) WaitUntilStored(health);
}

}  // namespace mapmend

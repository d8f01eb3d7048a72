#include "procs/mapmend/image_delivery.h"

#include <unistd.h>

#include <cstdio>
#include <optional>
#include <utility>

#include "procs/mapmend/backend.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

// Without progress: the store is gone, or its disk is full.
constexpr auto kPatience = std::chrono::seconds(15);
// For exports to be written once more with images that came late.
constexpr auto kExportPatience = std::chrono::seconds(60);
constexpr int kAskTimeoutMs = 500;

}  // namespace

std::string DescribeImages(const ImageStatus& status, const ImageFile& spool) {
  int64_t bytes = 0;
  for (const ImageFile::Entry& entry : spool.List()) bytes += entry.num_bytes;
  char text[120];
  std::snprintf(text, sizeof(text), "%d of %d images stored, %.1f MB to come", status.num_stored,
                status.num_stored + status.num_awaited, 1e-6 * static_cast<double>(bytes));
  return text;
}

ImageDelivery::ImageDelivery(Backend* backend, const std::string& spool, const std::set<std::string>& sessions)
    : backend_(backend), store_(std::make_unique<StoreClient>(backend->bus(), "images-" + std::to_string(getpid()))) {
  try {
    file_ = std::make_unique<ImageFile>(spool, ImageFile::Mode::kReadWrite);
  } catch (const std::exception& e) {
    backend->Tell(std::string(e.what()) + "; its images are not delivered");
    file_ = std::make_unique<ImageFile>("", ImageFile::Mode::kReadWrite);
  }
  ImageSenderOptions options;
  options.lcm_url = backend->Url();
  options.channel_prefix = backend->ChannelPrefix();
  options.sessions = sessions;
  sender_ = std::make_unique<ImageSender>(file_.get(), options);
}

ImageDelivery::~ImageDelivery() = default;

ImageFigures ImageDelivery::Finish(const std::function<void()>& tick,
                                   const std::function<void(const std::string&)>& show) {
  auto last_progress = Clock::now();
  int before = -1;
  ImageStatus status;
  bool is_whole = false;
  while (!is_whole && Clock::now() - last_progress < kPatience) {
    if (const auto answer = store_->AskImages("", kAskTimeoutMs)) {
      status = *answer;
      is_whole = status.num_awaited == 0;
      if (std::exchange(before, status.num_awaited) != status.num_awaited) last_progress = Clock::now();
    }
    if (is_whole) break;
    show(DescribeImages(status, *file_));
    tick();
  }
  if (is_whole) {
    sender_.reset();
    const std::string spool = file_->Path();
    file_.reset();
    if (!spool.empty()) RemoveImageFile(spool);
  } else {
    backend_->Tell(std::to_string(status.num_awaited) + " images were not stored; they are kept in " + file_->Path());
  }
  store_.reset();
  const auto deadline = Clock::now() + kExportPatience;
  const auto exported = [&] { return FindCounter(backend_->Health("viewer_export"), "images"); };
  while (exported() && *exported() != status.num_stored && backend_->ExportProblem().empty() &&
         Clock::now() < deadline) {
    show("writing the images");
    tick();
  }
  return {status.num_stored, status.num_awaited + status.num_lost};
}

}  // namespace mapmend

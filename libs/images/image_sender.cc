#include "libs/images/image_sender.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "libs/base/checksum.h"
#include "libs/bus/channels.h"
#include "libs/wire/image_codec.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

// A piece takes a quarter of a second on a slow link, so that other connections have their turn.
constexpr double kPieceSeconds = 0.25;
constexpr int kLeastPiece = 2 << 10, kMostPiece = 512 << 10;  // bytes
// What was asked for and is being sent is asked for again only because pieces are under way.
constexpr auto kUnderWay = std::chrono::milliseconds(1500);
constexpr size_t kMaxWaiting = 64;

}  // namespace

struct ImageSender::Impl {
  // An image that the store waits for.
  struct Job {
    std::string session;
    KeyframeId keyframe;
    int offset = 0;  // up to which it is sent
    Clock::time_point touched;
  };

  ImageFile* file;
  const ImageSenderOptions options;
  const int piece_bytes;
  Bus bus;
  std::deque<Job> jobs;
  std::optional<KeyframeImage> image;  // of the first job
  uint32_t crc = 0;
  double budget = 0;  // bytes that may be sent now
  Clock::time_point last_budget = Clock::now();
  std::atomic<int64_t> num_sent{0}, num_stored{0}, last_heard_ms{0};
  std::atomic<bool> stop{false};
  Subscription subscription;
  std::thread thread;

  Impl(ImageFile* f, const ImageSenderOptions& o)
      : file(f),
        options(o),
        piece_bytes(o.rate_kbit_s == 0
                        ? kMostPiece
                        : std::clamp(static_cast<int>(kPieceSeconds * 125 * o.rate_kbit_s), kLeastPiece, kMostPiece)),
        bus(o.lcm_url, o.channel_prefix) {
    subscription = bus.Subscribe<ImageRequest>(channels::kImageRequest, Delivery::kKeepAll,
                                               [this](const ImageRequest& request) { OnRequest(request); });
    thread = std::thread([this] { Run(); });
  }
  ~Impl() {
    stop = true;
    thread.join();
  }

  void OnRequest(const ImageRequest& request) {
    int64_t num_removed = 0;
    std::vector<KeyframeId> stored;
    for (const KeyframeId keyframe : request.stored) {
      if (file->Find(request.session, keyframe)) stored.push_back(keyframe);
      num_removed += std::erase_if(
          jobs, [&](const Job& job) { return job.session == request.session && job.keyframe == keyframe; });
      if (image && image->session == request.session && image->keyframe == keyframe) image.reset();
    }
    if (!stored.empty()) file->Remove(request.session, stored);
    num_stored += static_cast<int64_t>(stored.size());
    bool concerns_us = num_removed > 0 || !stored.empty();
    for (const WantedImage& wanted : request.wanted) concerns_us = OnWanted(request, wanted) || concerns_us;
    if (concerns_us)
      last_heard_ms = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now().time_since_epoch()).count();
  }

  bool OnWanted(const ImageRequest& request, const WantedImage& wanted) {
    const auto entry = file->Find(request.session, wanted.keyframe);
    // The number may be that of a keyframe which was never published, of a frontend that was killed.
    if (!entry || entry->frame != wanted.frame) {
      if (!options.sessions.contains(request.session)) return false;
      if (!options.is_pending || !options.is_pending(request.session, wanted.keyframe)) {
        ImagePiece none;
        none.image.session = request.session;
        none.image.keyframe = wanted.keyframe;
        none.image.frame = wanted.frame;
        bus.Publish(channels::kKeyframeImage, none);
      }
      return true;
    }
    const auto job = std::find_if(jobs.begin(), jobs.end(), [&](const Job& j) {
      return j.session == request.session && j.keyframe == wanted.keyframe;
    });
    if (job == jobs.end()) {
      if (jobs.size() < kMaxWaiting)
        jobs.push_back({request.session, wanted.keyframe,
                        static_cast<int>(std::min<int64_t>(wanted.offset, entry->num_bytes)), Clock::now()});
    } else if (wanted.offset < job->offset && Clock::now() - job->touched > kUnderWay) {
      job->offset = wanted.offset;  // a piece was lost
    }
    return true;
  }

  // Whether so much may be sent now.
  bool MaySend(int num_bytes) {
    if (options.rate_kbit_s == 0) return true;
    const auto now = Clock::now();
    const double rate = 125.0 * options.rate_kbit_s;
    budget = std::min<double>(budget + rate * std::chrono::duration<double>(now - last_budget).count(),
                              std::max<double>(piece_bytes, num_bytes));
    last_budget = now;
    return budget >= num_bytes;
  }

  // Sends a piece of the first image, if it is time. False: there is nothing to do now.
  bool SendPiece() {
    if (jobs.empty()) return false;
    Job& job = jobs.front();
    if (!image || image->session != job.session || image->keyframe != job.keyframe) {
      image = file->Get(job.session, job.keyframe);
      if (!image) {
        if (file->Find(job.session, job.keyframe)) {
          spdlog::error("{}: image of keyframe {} is damaged and is given up", file->Path(), job.keyframe.value);
          file->Remove(job.session, {job.keyframe});
        }
        jobs.pop_front();
        return true;
      }
      crc = Crc32(image->bytes.data(), image->bytes.size());
    }
    const int size = static_cast<int>(image->bytes.size());
    const int num_bytes = std::min(piece_bytes, size - job.offset);
    if (num_bytes <= 0) {
      jobs.pop_front();
      return true;
    }
    if (!MaySend(num_bytes)) return false;
    ImagePiece piece;
    piece.image = Described(*image);
    piece.image.bytes.assign(image->bytes.begin() + job.offset, image->bytes.begin() + job.offset + num_bytes);
    piece.size = size;
    piece.crc32 = crc;
    piece.offset = job.offset;
    if (!bus.Publish(channels::kKeyframeImage, piece)) return false;
    budget -= num_bytes;
    job.offset += num_bytes;
    job.touched = Clock::now();
    if (job.offset < size) return true;
    ++num_sent;
    jobs.pop_front();
    image.reset();
    return true;
  }

  // All but its bytes.
  static KeyframeImage Described(const KeyframeImage& image) {
    KeyframeImage described;
    described.session = image.session;
    described.keyframe = image.keyframe;
    described.frame = image.frame;
    described.utime = image.utime;
    described.width = image.width;
    described.height = image.height;
    described.encoding = image.encoding;
    return described;
  }

  void Run() {
    bool has_more = false;
    while (!stop) {
      try {
        bus.Handle(has_more ? 0 : jobs.empty() ? 50 : 10);
        has_more = SendPiece();
      } catch (const std::exception& e) {
        spdlog::error("images: {}", e.what());
        std::this_thread::sleep_for(std::chrono::milliseconds(500));
      }
    }
  }
};

int DefaultImageRate(const std::string& lcm_url) {
  constexpr int kLinkRate = 4000;
  for (const char* local : {"tcpq://127.", "tcpq://localhost", "udpm:", "memq:"}) {
    if (lcm_url.starts_with(local)) return 0;
  }
  return kLinkRate;
}

ImageSender::ImageSender(ImageFile* file, const ImageSenderOptions& options)
    : impl_(std::make_unique<Impl>(file, options)) {}

ImageSender::~ImageSender() = default;

int64_t ImageSender::NumSent() const { return impl_->num_sent; }

int64_t ImageSender::NumStored() const { return impl_->num_stored; }

int64_t ImageSender::LastHeardMs() const { return impl_->last_heard_ms; }

}  // namespace mapmend

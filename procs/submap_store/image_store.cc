#include "procs/submap_store/image_store.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "libs/bus/channels.h"
#include "libs/images/image_file.h"
#include "libs/wire/image_codec.h"
#include "procs/submap_store/request_queue.h"
#include "procs/submap_store/wanted_images.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int64_t kMaxImageBytesAtOnce = 4 << 20;
constexpr auto kLookInterval = std::chrono::seconds(1);
// After a failure of the disk.
constexpr auto kPause = std::chrono::milliseconds(500);

int64_t Milliseconds(Clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
}

}  // namespace

struct ImageStore::Impl {
  // What the store has told, for the thread.
  struct News {
    Keyframe keyframe;
    bool is_removed = false;
  };

  const ImageStoreOptions options;
  std::unique_ptr<ImageFile> file;  // null: it cannot be used
  Bus bus;
  RequestQueue requests;
  std::map<std::string, WantedImages> sessions;
  Clock::time_point next_look;
  bool is_failing = false;
  std::mutex mutex;  // guards news
  std::vector<News> news;
  std::atomic<int> num_stored{0}, num_awaited{0}, num_lost{0};
  std::atomic<bool> stop{false};
  std::vector<Subscription> subscriptions;
  std::thread thread;

  Impl(const ImageStoreOptions& o, std::vector<Keyframe> keyframes) : options(o), bus(o.lcm_url, o.channel_prefix) {
    OpenFile();
    for (Keyframe& keyframe : keyframes) news.push_back({std::move(keyframe), false});
    subscriptions.push_back(bus.Subscribe<ImagePiece>(channels::kKeyframeImage, Delivery::kKeepAll,
                                                      [this](const ImagePiece& piece) { OnPiece(piece); }));
    Serve<ImageFetch, ImageAnswer>(channels::kImageFetch, channels::kImageFetched,
                                   [this](const ImageFetch& request) { return Fetch(request); });
    Serve<ImageStatusRequest, ImageStatus>(channels::kImageStatusRequest, channels::kImageStatus,
                                           [this](const ImageStatusRequest& request) { return Status(request); });
    thread = std::thread([this] { Run(); });
  }
  ~Impl() {
    stop = true;
    thread.join();
  }

  void OpenFile() {
    try {
      file = std::make_unique<ImageFile>(options.path, ImageFile::Mode::kReadWrite);
    } catch (const std::exception& e) {
      spdlog::error("{}; no images are stored", e.what());
    }
  }

  template <typename Request, typename Reply>
  void Serve(const char* request_channel, const char* reply_channel, std::function<Reply(const Request&)> answer) {
    subscriptions.push_back(bus.Subscribe<Request>(
        request_channel, Delivery::kKeepAll, [this, request_channel, reply_channel, answer](const Request& request) {
          requests.Add({request_channel, request.requester, request.id}, Milliseconds(Clock::now()),
                       [this, reply_channel, answer, request] {
                         const std::vector<uint8_t> reply = Encode(answer(request));
                         bus.PublishRaw(reply_channel, reply.data(), static_cast<int>(reply.size()));
                         return static_cast<int64_t>(reply.size());
                       });
        }));
  }

  ImageAnswer Fetch(const ImageFetch& request) {
    ImageAnswer answer;
    answer.id = request.id;
    answer.requester = request.requester;
    std::optional<KeyframeImage> image;
    if (file) image = file->Get(request.session, request.keyframe);
    answer.status = image ? ImageAnswer::Status::kOk : ImageAnswer::Status::kNone;
    if (image) answer.image = std::move(*image);
    return answer;
  }

  ImageStatus Status(const ImageStatusRequest& request) {
    TakeNews();
    ImageStatus status;
    status.id = request.id;
    status.requester = request.requester;
    status.session = request.session;
    for (const auto& [session, wanted] : sessions) {
      if (!request.session.empty() && session != request.session) continue;
      status.num_stored += wanted.NumStored();
      status.num_lost += wanted.NumLost();
      status.num_awaited += static_cast<int>(wanted.Awaited().size());
      if (request.session.empty()) continue;
      for (const auto& [keyframe, frame] : wanted.Awaited()) status.awaited.push_back({keyframe, frame});
    }
    if (!file) status.num_lost = std::exchange(status.num_awaited, 0);
    return status;
  }

  void TakeNews() {
    std::vector<News> taken;
    {
      const std::lock_guard lock(mutex);
      taken.swap(news);
    }
    for (const auto& [keyframe, is_removed] : taken) {
      WantedImages& wanted = sessions[keyframe.session];
      if (is_removed) {
        wanted.Remove(keyframe.keyframe);
        continue;
      }
      const auto entry = file ? file->Find(keyframe.session, keyframe.keyframe) : std::nullopt;
      wanted.Add(keyframe.keyframe, keyframe.frame, entry && entry->frame == keyframe.frame);
    }
  }

  void OnPiece(const ImagePiece& piece) {
    const auto session = sessions.find(piece.image.session);
    if (session == sessions.end() || !file) return;
    const std::optional<KeyframeImage> image = session->second.Take(piece, Clock::now());
    if (!image) return;
    try {
      file->Put({*image});
      if (std::exchange(is_failing, false)) spdlog::info("{}: images are stored again", options.path);
      session->second.Stored(image->keyframe, Clock::now());
    } catch (const std::exception& e) {  // it is asked for again
      if (!std::exchange(is_failing, true)) spdlog::error("{}", e.what());
      std::this_thread::sleep_for(kPause);
    }
  }

  // Somebody has removed the file: a new one takes the images once more, of whoever still has them.
  void LookAtFile() {
    if (!file || Clock::now() < next_look) return;
    next_look = Clock::now() + kLookInterval;
    if (!file->IsGone()) return;
    spdlog::warn("{}: was removed; it is begun anew", options.path);
    file.reset();
    for (const char* suffix : {"-wal", "-shm"}) std::remove((options.path + suffix).c_str());
    OpenFile();
    for (auto& [session, wanted] : sessions) wanted.ForgetStored();
  }

  void Count() {
    ImageStatusRequest all;
    const ImageStatus status = Status(all);
    num_stored = status.num_stored;
    num_awaited = status.num_awaited;
    num_lost = status.num_lost;
  }

  void Run() {
    while (!stop) {
      try {
        bus.Handle(requests.Empty() ? 20 : 0);
        LookAtFile();
        Count();
        for (auto& [session, wanted] : sessions) {
          if (!file) break;
          if (const auto request = wanted.NextRequest(session, Clock::now()))
            bus.Publish(channels::kImageRequest, *request);
        }
        requests.Answer(Milliseconds(Clock::now()), kMaxImageBytesAtOnce);
      } catch (const std::exception& e) {
        if (!std::exchange(is_failing, true)) spdlog::error("{}", e.what());
        std::this_thread::sleep_for(kPause);
      }
    }
  }
};

ImageStore::ImageStore(const ImageStoreOptions& options, std::vector<Keyframe> keyframes)
    : impl_(std::make_unique<Impl>(options, std::move(keyframes))) {}

ImageStore::~ImageStore() = default;

void ImageStore::Add(Keyframe keyframe) {
  const std::lock_guard lock(impl_->mutex);
  impl_->news.push_back({std::move(keyframe), false});
}

void ImageStore::Remove(const std::string& session, KeyframeId keyframe) {
  const std::lock_guard lock(impl_->mutex);
  impl_->news.push_back({{session, keyframe, -1}, true});
}

ImageStore::Counts ImageStore::GetCounts() const { return {impl_->num_stored, impl_->num_awaited, impl_->num_lost}; }

}  // namespace mapmend

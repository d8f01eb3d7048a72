#include "procs/mosaic/mosaic_process.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "libs/base/text_format.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/map_view/map_model.h"
#include "libs/wire/revision_codec.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_consumer.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kFetchTimeoutMs = 2000;
constexpr auto kAskInterval = std::chrono::milliseconds(700);
constexpr auto kWorkTime = std::chrono::milliseconds(250);  // until the bus has its turn
constexpr auto kPatience = std::chrono::seconds(4);         // for images that do not come, once all else is there
constexpr auto kPatienceForFinal = std::chrono::seconds(30);
constexpr int kImagesAtOnce = 4;
constexpr auto kMostWithoutDrawing = std::chrono::seconds(2);
constexpr int kNiceness = 10;  // tracking and merging go first

struct StoreIsSilent : std::runtime_error {
  StoreIsSilent() : std::runtime_error("the store does not answer") {}
};

// The loop of the process: records, revisions and images in, tiles out.
class MosaicLoop {
 public:
  MosaicLoop(const MosaicProcessOptions& options, Bus* bus)
      : options_(options),
        health_(bus, "mosaic"),
        bus_(bus),
        store_(bus, "mosaic-" + std::to_string(getpid())),
        file_(options.out),
        images_(&file_, [this](const std::string& session, KeyframeId keyframe) { return Fetch(session, keyframe); }),
        scene_(options.scene, Noted("mapmend_frames")),
        tiles_(options.tiles, &file_, [this](int id, int side) { return images_.Fetch(id, side); }),
        consumer_(bus, &store_, [this](const Record& record) { OnRecord(record); }) {
    transforms_ = bus->Subscribe<MergedTransforms>(channels::kMergedTransforms, Delivery::kKeepAll,
                                                   [this](const MergedTransforms& transforms) {
                                                     model_.SetTransforms(transforms);
                                                     announced_ = std::max(announced_, transforms.revision);
                                                   });
  }

  void Run() {
    health_.SetState("ready");
    while (!StopRequested()) {
      const bool is_busy = tiles_.HasWork();
      const int delivered = consumer_.Spin(is_busy ? 1 : 50, kRecordsAtOnce);
      health_.Tick();
      if (file_.IsGone()) throw std::runtime_error(options_.out + ": was removed or replaced");
      // Catches up first: a look at the map in between would be out of date.
      if (delivered < kRecordsAtOnce) {
        try {
          Draw();
        } catch (const StoreIsSilent&) {
          spdlog::debug("mosaic: the store does not answer, trying again");
        }
      }
      Report();
    }
  }

 private:
  static constexpr int kRecordsAtOnce = 64;

  std::string Noted(const std::string& name) const {
    const auto metadata = file_.Metadata();
    const auto it = metadata.find(name);
    return it == metadata.end() ? "" : it->second;
  }

  std::optional<KeyframeImage> Fetch(const std::string& session, KeyframeId keyframe) {
    health_.Tick();
    auto answer = store_.FetchImage(session, keyframe, kFetchTimeoutMs);
    if (!answer) throw StoreIsSilent();
    if (answer->status != ImageAnswer::Status::kOk) return std::nullopt;
    return std::move(answer->image);
  }

  void OnRecord(const Record& record) {
    const std::string problem = model_.Apply(record);
    if (!problem.empty() && num_bad_records_++ == 0)
      spdlog::error("mosaic: record {} of session {}: {}", record.header.seq, record.header.session, problem);
  }

  // As the viewer does: when one was announced, or now and then once everything has ended.
  void FetchRevision() {
    const bool is_behind = announced_ > fetched_, is_waiting = model_.AllEnded() && !model_.IsComplete();
    if ((!is_behind && !is_waiting) || Clock::now() < next_revision_) return;
    next_revision_ = Clock::now() + kAskInterval;
    StoreClient::FetchedRevision stored = store_.FetchRevision(-1, kFetchTimeoutMs);
    if (stored.number <= fetched_) return;
    if (!stored.error.empty()) {
      spdlog::error("mosaic: revision {}: {}", stored.number, stored.error);
    } else if (stored.status == StoreClient::RevisionStatus::kOk) {
      model_.SetRevision(std::move(stored.revision));
    } else {
      return;
    }
    fetched_ = stored.number;
  }

  // Whether the store has had images since it was asked the last time.
  void AskImages() {
    if (Clock::now() < next_images_) return;
    next_images_ = Clock::now() + kAskInterval;
    const auto status = store_.AskImages("", kFetchTimeoutMs);
    if (!status) throw StoreIsSilent();
    if (status->num_stored != num_stored_ || status->num_awaited != num_awaited_) images_changed_at_ = Clock::now();
    if (status->num_stored != num_stored_) images_.Retry();
    num_stored_ = status->num_stored;
    num_awaited_ = status->num_awaited;
  }

  bool MayBeFinal() const {
    const bool is_awaited = num_awaited_ > 0 && Clock::now() - images_changed_at_ < kPatience;
    return model_.IsComplete() && model_.Revision().transforms.revision <= fetched_ && !has_more_images_ && !is_awaited;
  }

  // Once everything has ended the final map is near, of which all is drawn anew: what it would be drawn over is left as
  // it is, unless the final map is long in coming.
  bool IsFinalNear() {
    if (!model_.AllEnded() || model_.IsComplete()) {
      ended_at_.reset();
      return false;
    }
    if (!ended_at_) ended_at_ = Clock::now();
    return Clock::now() - *ended_at_ < kPatienceForFinal;
  }

  void Draw() {
    FetchRevision();
    AskImages();
    const bool is_final_near = IsFinalNear();
    LookAtMap(is_final_near);
    if (!tiles_.HasWork() || is_final_near) return;
    tiles_.Work(Clock::now() + kWorkTime);
  }

  void LookAtMap(bool is_final_near) {
    const auto begin = Clock::now();
    if (begin < next_look_) return;
    const bool is_final = MayBeFinal();
    const bool is_new = model_.Version() != version_ || num_stored_ != stored_at_look_ || is_final != is_final_ ||
                        is_final_near != was_final_near_;
    if (!is_new && !has_more_images_) return;
    was_final_near_ = is_final_near;
    const Snapshot snapshot = MakeSnapshot(model_);
    version_ = model_.Version();
    stored_at_look_ = num_stored_;
    const int num_read = ReadImages(snapshot, is_final_near);
    if (is_final_near) return;
    // Whoever has much to read, after a start, draws now and then only.
    if (has_more_images_ && begin - drawn_at_ < kMostWithoutDrawing) return;
    drawn_at_ = begin;
    is_final_ = is_final && num_read == 0;
    tiles_.SetScene(scene_.Make(snapshot, images_, is_final_), scene_.Focus(), is_final_);
    TileFile::Changes changes;
    changes.metadata = scene_.Metadata(tiles_.Scene());
    changes.metadata["minzoom"] = std::to_string(std::max(0, tiles_.Scene().zoom - options_.tiles.num_zooms + 1));
    if (changes.metadata != metadata_) file_.Put(changes);
    metadata_ = std::move(changes.metadata);
    const auto end = Clock::now();
    const auto pause = std::chrono::duration_cast<Clock::duration>(options_.pause_share * (end - begin));
    const auto least =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.min_interval_s));
    if (!has_more_images_) next_look_ = end + std::max(pause, least);
  }

  // Images that are to be drawn soon stay decoded.
  int ReadImages(const Snapshot& snapshot, bool is_final_near) {
    const auto keep = [this](int id, cv::Mat pixels) { tiles_.Keep(id, std::move(pixels)); };
    const int num_read =
        is_final_near ? images_.Read(snapshot, kImagesAtOnce, {}) : images_.Read(snapshot, kImagesAtOnce, keep);
    has_more_images_ = num_read == kImagesAtOnce;
    return num_read;
  }

  void Report() {
    for (const StreamConsumer::Cursor& cursor : consumer_.Cursors()) health_.SetCursor(cursor.session, cursor.seq);
    health_.SetQueueDepth(consumer_.QueueDepth());
    health_.SetCounter("revision", static_cast<double>(model_.Revision().transforms.revision));
    health_.SetCounter("bad_messages",
                       static_cast<double>(bus_->NumRefused() + consumer_.NumRefused() + num_bad_records_));
    health_.SetCounter("units_made", static_cast<double>(tiles_.NumMade()));
    health_.SetCounter("units_pending", tiles_.NumPending());
    const bool is_settled = is_final_ && version_ == model_.Version() && MayBeFinal();
    if (is_settled && tiles_.NumPending() == 0) {
      health_.SetState("done", scene_.Problem());
    } else if (tiles_.NumPending() > 0) {
      health_.SetState("busy", Format("tiles of the ground: %d to look at", tiles_.NumPending()));
    } else {
      health_.SetState(model_.SessionOrder().empty() ? "ready" : "busy", scene_.Problem());
    }
    health_.Tick();
  }

  const MosaicProcessOptions& options_;
  HealthReporter health_;
  Bus* bus_;
  StoreClient store_;
  TileFile file_;
  KnownImages images_;
  LiveScene scene_;
  TileMosaic tiles_;
  MapModel model_;
  StreamConsumer consumer_;
  Subscription transforms_;
  int64_t num_bad_records_ = 0;
  int64_t announced_ = -1, fetched_ = -1;  // revisions
  int64_t version_ = -1;                   // of the model, when it was looked at
  int num_stored_ = -1, num_awaited_ = 0, stored_at_look_ = -1;
  bool has_more_images_ = false, is_final_ = false, was_final_near_ = false;
  std::map<std::string, std::string> metadata_;
  std::optional<Clock::time_point> ended_at_;  // since when everything has ended, and no final map has come
  Clock::time_point next_revision_, next_images_, next_look_, images_changed_at_, drawn_at_;
};

// Tiles can be made again: a file that cannot be read is kept beside, and a new one begun.
void SetAsideIfDamaged(const std::string& path) {
  try {
    const TileFile file(path);
    file.Metadata();
    file.Notes();
    file.Images();
  } catch (const std::runtime_error& e) {
    std::error_code error;
    if (!std::filesystem::exists(path, error)) throw;
    spdlog::warn("mosaic: {}: it is kept as {}.damaged", e.what(), path);
    std::filesystem::rename(path, path + ".damaged");
    for (const char* suffix : {"-wal", "-shm"}) std::filesystem::remove(path + suffix, error);
  }
}

}  // namespace

int RunMosaicProcess(const MosaicProcessOptions& options) {
  if (options.out.empty()) throw std::runtime_error("--out is missing: the file of tiles");
  setpriority(PRIO_PROCESS, 0, kNiceness);
  cv::setNumThreads(1);
  InstallSignalHandlers();
  SetAsideIfDamaged(options.out);
  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  MosaicLoop(options, &bus).Run();
  return 0;
}

}  // namespace mapmend

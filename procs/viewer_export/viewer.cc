#include "procs/viewer_export/viewer.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "libs/base/text_format.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/bus/process.h"
#include "libs/map_view/snapshot.h"
#include "libs/wire/revision_codec.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_codec.h"
#include "libs/wire/stream_consumer.h"
#include "procs/viewer_export/exporter.h"
#include "procs/viewer_export/picture_store.h"
#include "procs/viewer_export/restoration.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

// How long one read of a revision may take before the loop goes on; it is tried again.
constexpr int kFetchTimeoutMs = 1500;
// How often the store is asked for a revision that was not announced here (it may have been made before this process
// began).
constexpr auto kAskInterval = std::chrono::seconds(1);
// The stacks of the merging process likewise.
constexpr auto kStacksInterval = std::chrono::seconds(1);
// How often the store is asked whether more images have come, and how long images that do not come are waited for.
constexpr auto kImagesInterval = std::chrono::milliseconds(500);
constexpr auto kImagesPatience = std::chrono::seconds(4), kLatePatience = std::chrono::seconds(60);

}  // namespace

struct Viewer::Impl {
  Impl(const ViewerOptions& viewer_options, std::unique_ptr<LivePage> live_page, Bus* the_bus)
      : options(viewer_options),
        bus(the_bus),
        health(bus, "viewer_export"),
        store(bus, "viewer_export-" + std::to_string(getpid())),
        consumer(bus, &store, [this](const Record& record) { OnRecord(record); }),
        page(std::move(live_page)) {
    Subscribe();
  }

  void Subscribe();
  void OnRecord(const Record& record);
  void FetchRevision();
  void AskImages();
  bool MayExport();
  void ExportIfComplete();
  void CountForHealth();
  void UpdateLivePage();
  // What `mapmend status` shows of the merging process.
  const std::string& Stacks();
  void AskDecisions();
  // A sign of life in the middle of long work.
  void WorkOn() {
    health.Tick();
    if (page != nullptr) page->Update(model, false, true);
  }
  const GroundTruth* TruthOrNull() const { return options.ground_truth ? &*options.ground_truth : nullptr; }

  const ViewerOptions options;
  Bus* bus;
  HealthReporter health;
  StoreClient store;
  StreamConsumer consumer;
  MapModel model;
  std::unique_ptr<LivePage> page;  // null: none
  int64_t decided_at = -2;         // revision that the decisions on the page were asked for
  int64_t num_bad_records = 0;
  int64_t announced = -1;             // newest revision that the merger spoke of
  int64_t fetched = -1;               // newest revision read from the store
  int64_t exported_version = -1;      // of the model, when it was last exported
  std::optional<ImageStatus> images;  // as of the last answer; none before it
  int exported_images = -1;           // that were stored when the map was last exported
  Clock::time_point images_changed_at;
  Clock::time_point next_ask, next_stacks, next_images;
  std::string stacks;
  int64_t stacks_version = -1;  // of the model, when they were worked out
  std::vector<Subscription> subscriptions;
};

void Viewer::Impl::Subscribe() {
  subscriptions.push_back(bus->Subscribe<MergedTransforms>(channels::kMergedTransforms, Delivery::kKeepAll,
                                                           [this](const MergedTransforms& transforms) {
                                                             model.SetTransforms(transforms);
                                                             announced = std::max(announced, transforms.revision);
                                                           }));
  subscriptions.push_back(bus->Subscribe<EvaluatedConnection>(
      channels::kConnection, Delivery::kKeepAll,
      [this](const EvaluatedConnection& connection) { model.SetConnection(connection); }));
  if (page == nullptr) return;
  subscriptions.push_back(bus->Subscribe<FramePose>(channels::kFramePose, Delivery::kLatest,
                                                    [this](const FramePose& pose) { page->OnFramePose(pose); }));
  subscriptions.push_back(bus->Subscribe<Health>(channels::kHealth, Delivery::kKeepAll,
                                                 [this](const Health& told) { page->OnHealth(told); }));
}

void Viewer::Impl::OnRecord(const Record& record) {
  const std::string problem = model.Apply(record);
  if (problem.empty() && page != nullptr) page->OnRecord(record, model);
  if (problem.empty()) return;
  if (num_bad_records++ == 0) {
    spdlog::error("viewer_export: record {} of session {}: {}", record.header.seq, record.header.session, problem);
  }
}

// Reads the newest stored revision when one was announced that is not known in full, or now and then when everything
// has ended.
void Viewer::Impl::FetchRevision() {
  const bool behind = announced > fetched;
  const bool waiting = model.AllEnded() && !model.IsComplete();
  if ((!behind && !waiting) || Clock::now() < next_ask) return;
  next_ask = Clock::now() + kAskInterval;
  StoreClient::FetchedRevision stored = store.FetchRevision(-1, kFetchTimeoutMs);
  if (stored.number <= fetched) return;
  if (!stored.error.empty()) {
    spdlog::error("viewer_export: revision {}: {}", stored.number, stored.error);
  } else if (stored.status == StoreClient::RevisionStatus::kOk) {
    if (model.SetRevision(std::move(stored.revision)) && page != nullptr) page->OnRevision(model);
  } else {
    return;
  }
  fetched = stored.number;
}

// Once the map is final, and now and then afterwards: images may come later than all else.
void Viewer::Impl::AskImages() {
  if (options.out.empty() || Clock::now() < next_images) return;
  next_images = Clock::now() + kImagesInterval;
  auto status = store.AskImages("", kFetchTimeoutMs);
  if (!status) return;
  const bool is_new = !images || images->num_stored != status->num_stored || images->num_awaited != status->num_awaited;
  if (is_new) images_changed_at = Clock::now();
  images = std::move(status);
}

// Images are worth a little patience, as long as they come.
bool Viewer::Impl::MayExport() {
  AskImages();
  // What was exported without them is not exported for each of them.
  const auto patience = exported_version == model.Version() ? kLatePatience : kImagesPatience;
  const bool is_awaited = images && images->num_awaited > 0 && Clock::now() - images_changed_at < patience;
  const int stored = images ? images->num_stored : 0;
  if (exported_version == model.Version() && exported_images == stored) return false;
  if (is_awaited && exported_version == model.Version()) return false;
  if (is_awaited) {
    health.SetState("busy", "waits for " + std::to_string(images->num_awaited) + " images");
    return false;
  }
  exported_version = model.Version();
  exported_images = stored;
  return true;
}

void Viewer::Impl::ExportIfComplete() {
  // A final revision counts once it has been read with its parts, not when only its transforms were announced.
  if (!model.IsComplete() || model.Revision().transforms.revision > fetched) {
    health.SetState(model.SessionOrder().empty() ? "ready" : "busy", Stacks());
    return;
  }
  if (!MayExport()) return;
  if (!options.out.empty()) {
    const auto start = Clock::now();
    ExportOptions exports = options.exports;
    exports.pictures = PicturesOf(&store, [this] { WorkOn(); });
    exports.progress = [this](double share) {
      health.SetState("busy", Format("picture of the ground: %.0f %%", 100 * share));
      WorkOn();
    };
    const std::vector<std::string> problems = ExportAll(model, TruthOrNull(), options.out, exports);
    health.SetCounter("images", exported_images);
    for (const std::string& problem : problems) spdlog::error("viewer_export: {}", problem);
    health.SetCounter("exports_failed", static_cast<double>(problems.size()));
    if (!problems.empty()) {
      health.SetState(
          "done", problems.front() +
                      (problems.size() == 1 ? "" : " (and " + std::to_string(problems.size() - 1) + " other exports)"));
      return;
    }
    spdlog::info("viewer_export: revision {} written to {} in {:.2f} s", model.Revision().transforms.revision,
                 options.out, std::chrono::duration<double>(Clock::now() - start).count());
  }
  health.SetState("done", options.out.empty() ? "" : "exports are in " + options.out);
}

// Before the state is set, because a change of state is published at once with what is counted here.
void Viewer::Impl::CountForHealth() {
  for (const StreamConsumer::Cursor& cursor : consumer.Cursors()) health.SetCursor(cursor.session, cursor.seq);
  health.SetQueueDepth(consumer.QueueDepth());
  health.SetCounter("revision", static_cast<double>(model.Revision().transforms.revision));
  health.SetCounter("bad_messages", static_cast<double>(bus->NumRefused() + consumer.NumRefused() + num_bad_records));
}

const std::string& Viewer::Impl::Stacks() {
  if (page != nullptr) return page->Stacks();
  if (model.Version() == stacks_version || Clock::now() < next_stacks) return stacks;
  const auto started = Clock::now();
  stacks = DescribeStacks(MakeSnapshot(model));
  stacks_version = model.Version();
  // A large map takes a while to be worked out: at most a fiftieth of the time goes into it.
  constexpr int kPauseShare = 50;
  const auto now = Clock::now();
  next_stacks = now + std::max<Clock::duration>(kStacksInterval, kPauseShare * (now - started));
  return stacks;
}

void Viewer::Impl::UpdateLivePage() {
  if (page == nullptr) return;
  AskDecisions();
  page->AnswerOne(model, PicturesOf(&store),
                  [this](const EdgeDecision& decision) { return store.DecideEdges({decision}, kFetchTimeoutMs); });
  page->Update(model, exported_version == model.Version());
}

// They are part of what a revision was made from, so with each revision they may have changed.
void Viewer::Impl::AskDecisions() {
  if (decided_at == fetched || model.SessionOrder().empty()) return;
  decided_at = fetched;
  if (const auto decisions = store.DecideEdges({}, kFetchTimeoutMs)) page->SetDecisions(*decisions);
}

Viewer::Viewer(const ViewerOptions& options, std::unique_ptr<LivePage> page, Bus* bus)
    : impl_(std::make_unique<Impl>(options, std::move(page), bus)) {}

Viewer::~Viewer() = default;

void Viewer::Run() {
  LivePage* page = impl_->page.get();
  if (page != nullptr) spdlog::info("viewer_export: live page at {}", page->Url());
  while (!StopRequested()) {
    impl_->consumer.Spin(50);
    impl_->FetchRevision();
    impl_->CountForHealth();
    impl_->ExportIfComplete();
    impl_->health.Tick();
    impl_->UpdateLivePage();
  }
  if (page != nullptr) page->Stop(impl_->model, impl_->exported_version == impl_->model.Version());
}

}  // namespace mapmend

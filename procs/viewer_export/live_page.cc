#include "procs/viewer_export/live_page.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "procs/viewer_export/connection_picture.h"
#include "procs/viewer_export/live_feed.h"
#include "procs/viewer_export/live_map.h"
#include "procs/viewer_export/live_overview.h"
#include "procs/viewer_export/live_server.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;
using Question = LiveQuestions::Question;

// The feed is brought up to date at most this often; nobody sees it sooner.
constexpr auto kInterval = std::chrono::milliseconds(400);
// Without a page the little that `mapmend status` shows of it is enough.
constexpr auto kIdleInterval = std::chrono::milliseconds(1000);
// What takes longer than this between two updates was work during which nothing was heard.
constexpr auto kLongWork = std::chrono::milliseconds(1000);
constexpr int kPictureHeight = 540;  // pixels

LiveServerOptions ServerOptions(const PageOptions& options) {
  return {options.bind, options.port, options.files, options.token, ""};
}

LiveQuestions::Answer Nothing(const std::string& why) { return {404, "text/plain; charset=utf-8", why}; }

LiveQuestions::Answer Jpeg(const std::vector<uint8_t>& bytes, const std::string& otherwise) {
  if (bytes.empty()) return Nothing(otherwise);
  return {200, "image/jpeg", {bytes.begin(), bytes.end()}};
}

}  // namespace

struct LivePage::Impl {
  Impl(const PageOptions& page, const OverviewOptions& overview_options)
      : overview(overview_options), server(ServerOptions(page), &feed, &questions) {
    run.folder = page.files.empty() ? "" : std::filesystem::absolute(page.files).lexically_normal().string();
    run.is_stored = page.is_stored;
    run.can_decide = !page.token.empty();
  }

  LiveFeed feed;
  LiveQuestions questions;
  LiveMap map;
  LiveOverview overview;
  LiveRun run;
  Clock::time_point next;
  int64_t parts_version = -1;  // of the model, when its parts were last told, with these decisions
  std::vector<EdgeDecision> parts_decisions;
  LiveServer server;  // uses what stands before it
};

LivePage::LivePage(const PageOptions& options, const PlacementOptions& placement, const CoverageOptions& coverage)
    : impl_(std::make_unique<Impl>(options, OverviewOptions{placement, coverage, options.files})),
      last_update_(Clock::now()) {
  PublishState(MapModel(), inputs_, impl_->run, &impl_->feed);
}

LivePage::~LivePage() = default;

void LivePage::OnRecord(const Record& record, const MapModel& model) { impl_->map.OnRecord(record, model); }

void LivePage::OnRevision(const MapModel& model) { impl_->map.OnRevision(model); }

void LivePage::Update(const MapModel& model, bool exported, bool is_deaf) {
  const auto now = Clock::now();
  if (is_deaf || now > last_update_ + kLongWork) inputs_.WasDeaf(now - last_update_);
  last_update_ = now;
  if (now < impl_->next) return;
  impl_->next = now + (impl_->server.NumPages() > 0 ? kInterval : kIdleInterval);
  const int64_t before = impl_->feed.Version();
  impl_->run.exported = exported;
  PublishState(model, inputs_, impl_->run, &impl_->feed);
  if (model.Version() != impl_->parts_version || decisions_ != impl_->parts_decisions) {
    PublishParts(model, decisions_, &impl_->feed);
    impl_->parts_version = model.Version();
    impl_->parts_decisions = decisions_;
  }
  impl_->overview.Publish(model, model.IsComplete(), &impl_->feed);
  impl_->map.Publish(model, &impl_->feed);
  if (impl_->feed.Version() != before) impl_->server.Wake();
}

void LivePage::Stop(const MapModel& model, bool exported) {
  impl_->run.exported = exported;
  impl_->run.has_stopped = true;
  PublishState(model, inputs_, impl_->run, &impl_->feed);
  impl_->server.Flush();
}

LiveQuestions::Answer LivePage::Answer(const Question& question, const MapModel& model, const PictureSource& pictures,
                                       const Decide& decide) {
  const SubmapKey a = ParsePageKey(model, question.a), b = ParsePageKey(model, question.b);
  if (question.kind == Question::Kind::kKeyframePicture) {
    if (!a.submap.IsValid()) return Nothing("There is no such submap.\n");
    return Jpeg(
        DrawKeyframe(model, a, KeyframeId(question.keyframe), pictures.image, kPictureHeight, question.features),
        "There is no such keyframe.\n");
  }
  const auto& connections = model.Revision().connections;
  const auto connection = std::find_if(connections.begin(), connections.end(), [&](const EvaluatedConnection& c) {
    return (c.a == a && c.b == b) || (c.a == b && c.b == a);
  });
  if (!a.submap.IsValid() || connection == connections.end()) return Nothing("There is no such connection.\n");
  if (question.kind == Question::Kind::kEdgePicture) {
    return Jpeg(DrawConnection(MakeSnapshot(model), *connection, pictures, {kPictureHeight, "jpeg"}),
                "There is nothing to show: no two of their keyframes look alike.\n");
  }
  const auto decisions = decide({connection->a, connection->b, question.disabled});
  if (!decisions) return {503, "text/plain; charset=utf-8", "The store does not answer.\n"};
  decisions_ = *decisions;
  impl_->next = Clock::now();
  return {200, "text/plain; charset=utf-8",
          question.disabled ? "Switched off; the map is being made without it.\n"
                            : "Switched on; the merger decides about it again.\n"};
}

void LivePage::AnswerOne(const MapModel& model, const PictureSource& pictures, const Decide& decide) {
  impl_->questions.AnswerOne([&](const Question& question) { return Answer(question, model, pictures, decide); });
}

const std::string& LivePage::Stacks() const { return impl_->overview.Stacks(); }

std::string LivePage::Url() const { return impl_->server.Url(); }

}  // namespace mapmend

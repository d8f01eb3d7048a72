#include "procs/frontend/resume.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "libs/wire/store_client.h"

namespace mapmend {
namespace {

constexpr int kWaitMs = 500;

}  // namespace

ResumePoint FindResumePoint(const RunOptions& options, const std::string& session, StreamSender* sender,
                            HealthReporter* health) {
  if (!options.resume && sender->LastSeq() < 0) return {};
  // A connection of its own: the sender's thread handles the other one.
  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  StoreClient store(&bus, "frontend-" + std::to_string(getpid()));
  const auto begin = std::chrono::steady_clock::now();
  while (!StopRequested()) {
    health->Tick();
    std::optional<SessionProgress> progress;
    if (sender->Flush(kWaitMs)) progress = store.AskProgress(session, 2 * kWaitMs);
    if (!progress) {
      if (std::chrono::steady_clock::now() - begin > std::chrono::seconds(1))
        health->SetState("starting", "waits for the store, to go on with session " + session);
      continue;
    }
    if (progress->status != SessionProgress::Status::kOk) {
      // What the outbox remembers went to another store.
      sender->ContinueAfter(-1);
      return {};
    }
    sender->ContinueAfter(progress->cumulative);
    ResumePoint point;
    point.is_resumed = true;
    point.ended = progress->ended;
    point.ids.next_submap = progress->next_submap;
    point.ids.next_keyframe = progress->next_keyframe;
    point.ids.next_point = progress->next_point;
    point.open_submap = progress->open_submap.value;
    point.last_frame = progress->last_frame;
    point.last_utime = progress->last_utime;
    spdlog::info("session {}: going on after record {}, frame {}", session, progress->cumulative, point.last_frame);
    return point;
  }
  throw std::runtime_error("stopped while waiting for the store, to go on with session " + session);
}

void EndOpenSubmap(const ResumePoint& point, StreamSender* sender) {
  if (point.open_submap < 0) return;
  sender->Append(point.last_utime, SubmapEnded{SubmapId(point.open_submap), "interrupted",
                                               "the frontend was started again", point.last_frame, point.last_utime});
}

}  // namespace mapmend

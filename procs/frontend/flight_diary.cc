#include "procs/frontend/flight_diary.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace {

std::string Readable(std::string cause) {
  std::replace(cause.begin(), cause.end(), '_', ' ');
  return cause;
}

}  // namespace

void FlightDiary::OnStart(const std::string& session, const std::string& source, int width, int height) {
  spdlog::info("frontend: session {}: {}, {} x {} pixels", session, source, width, height);
  events_->Add("start", {{"session", session}, {"source", source}, {"width", width}, {"height", height}});
}

void FlightDiary::OnFrame(const Frame& frame, const FrameOutcome& outcome) {
  if (outcome.abandoned != LossReason::kNone) {
    Count(ToString(outcome.abandoned), unconfirmed_);
    unconfirmed_ = 0;
  }
  if (outcome.state != FrontendState::kTracking) {
    Count(ToString(outcome.cause), 1);
  } else if (phase_ == Phase::kLooking) {
    ++unconfirmed_;
  }
  const bool is_lost = outcome.state == FrontendState::kLost;
  const bool goes_on = outcome.submap == submap_ && (is_lost || outcome.state == FrontendState::kTracking);
  if (phase_ != Phase::kLooking && !goes_on) CloseSubmap(frame);
  if (outcome.state == FrontendState::kTracking) {
    last_frame_ = frame.index;
    last_utime_ = frame.utime;
    last_submap_ = outcome.submap;
  }
  if (outcome.submap_begin >= 0) NoteBegin(outcome.submap, outcome.submap_begin, frame.index, frame.utime);
  if (phase_ == Phase::kTracking && is_lost) {
    NoteLoss(frame, outcome);
  } else if (phase_ == Phase::kLost && outcome.state == FrontendState::kTracking) {
    phase_ = Phase::kTracking;
    SetFound(frame.index);
    spdlog::info("frontend: submap {} found again at frame {} ({})", submap_.value, frame.index,
                 FormatUtime(frame.utime));
    events_->Add("found_again", {{"frame", frame.index}, {"utime", frame.utime}, {"submap", submap_.value}});
  }
}

void FlightDiary::OnFinished(int submap_begin) {
  if (submap_begin >= 0) NoteBegin(last_submap_, submap_begin, last_frame_, last_utime_);
}

void FlightDiary::NoteBegin(SubmapId submap, int first_frame, int frame, int64_t utime) {
  phase_ = Phase::kTracking;
  submap_ = submap;
  unconfirmed_ = 0;
  if (any_submap_) SetFound(first_frame);
  any_submap_ = true;
  spdlog::info("frontend: submap {} begins with frame {}, seen at frame {} ({})", submap.value, first_frame, frame,
               FormatUtime(utime));
  events_->Add("submap", {{"frame", frame}, {"utime", utime}, {"submap", submap.value}, {"first_frame", first_frame}});
}

void FlightDiary::NoteLoss(const Frame& frame, const FrameOutcome& outcome) {
  phase_ = Phase::kLost;
  loss_cause_ = ToString(outcome.cause);
  health_->SetCounter("lost_frame", last_frame_);
  health_->SetCounter("lost_utime", static_cast<double>(last_utime_));
  health_->SetCounter("found_frame", -1);
  spdlog::info("frontend: tracking lost at frame {} ({}): {}", frame.index, FormatUtime(frame.utime),
               Readable(ToString(outcome.cause)));
  events_->Add("lost", {{"frame", frame.index},
                        {"utime", frame.utime},
                        {"submap", submap_.value},
                        {"reason", ToString(outcome.cause)},
                        {"last_frame", last_frame_}});
}

void FlightDiary::Count(const std::string& cause, int num_frames) {
  if (num_frames == 0) return;
  const std::string name = cause.empty() ? "unknown" : cause;
  untracked_[name] += num_frames;
  health_->SetCounter("untracked." + name, untracked_[name]);
}

void FlightDiary::SetFound(int frame) { health_->SetCounter("found_frame", frame); }

void FlightDiary::CloseSubmap(const Frame& frame) {
  phase_ = Phase::kLooking;
  spdlog::info("frontend: submap {} ends with frame {}, given up at frame {} ({}): {}", submap_.value, last_frame_,
               frame.index, FormatUtime(frame.utime), Readable(loss_cause_));
  events_->Add("submap_ended", {{"frame", frame.index},
                                {"utime", frame.utime},
                                {"submap", submap_.value},
                                {"reason", loss_cause_},
                                {"last_frame", last_frame_}});
  submap_ = SubmapId();
}

void FlightDiary::OnEnd(int num_frames, int num_tracked, int64_t num_dropped) {
  Count("end_of_input", unconfirmed_);
  nlohmann::ordered_json untracked = nlohmann::ordered_json::object();
  std::string causes;
  for (const auto& [cause, count] : untracked_) {
    untracked[cause] = count;
    causes +=
        (causes.empty() ? "; without a pose when they came: " : ", ") + std::to_string(count) + " " + Readable(cause);
  }
  spdlog::info("frontend: end: {} frames, {} tracked{}", num_frames, num_tracked, causes);
  events_->Add("end",
               {{"frames", num_frames}, {"tracked", num_tracked}, {"dropped", num_dropped}, {"untracked", untracked}});
}

}  // namespace mapmend

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "libs/base/stop_request.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/capture/image_list.h"
#include "libs/capture/image_mask.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/stream/session_id.h"
#include "libs/wire/stream_codec.h"
#include "libs/wire/stream_sender.h"
#include "procs/frontend/flight_diary.h"
#include "procs/frontend/frame_queue.h"
#include "procs/frontend/frontend_input.h"
#include "procs/frontend/keyframe_images.h"
#include "procs/frontend/position_input.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/resume.h"
#include "procs/frontend/run_options.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kExitPartOfInput = 3;  // not all of the input could be used
constexpr int kTickMs = 200;
// At the end, without progress: a store that refuses, and asked to stop, when the store may be gone.
constexpr int kRefusedTimeoutMs = 20000, kStopTimeoutMs = 1500;

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<long>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

FramePose PoseOf(const std::string& session, const Frame& frame, const FrameOutcome& outcome) {
  const bool tracked = outcome.state == FrontendState::kTracking;
  FramePose pose;
  pose.submap = {session, tracked ? outcome.submap : SubmapId()};
  pose.utime = frame.utime;
  pose.frame = frame.index;
  pose.state = tracked ? "tracking" : outcome.state == FrontendState::kLost ? "lost" : "initialising";
  pose.cam_from_submap = outcome.cam_from_submap;
  pose.num_inliers = outcome.num_inliers;
  return pose;
}

// For the report: "a.mp4", or "a.mp4 and 2 more".
std::string NameInputs(const std::vector<std::string>& inputs) {
  const std::filesystem::path first = std::filesystem::absolute(inputs.front()).lexically_normal();
  const std::string name = (first.filename().empty() ? first.parent_path() : first).filename().string();
  return inputs.size() == 1 ? name : name + " and " + std::to_string(inputs.size() - 1) + " more";
}

SessionStarted DescribeSession(const RunOptions& options, const Camera& camera, const Pyramid& pyramid,
                               const Vocabulary& vocabulary, int num_frames) {
  SessionStarted started;
  started.version = MAPMEND_VERSION;
  started.vehicle = options.vehicle;
  started.source = options.mode == InputMode::kLive ? (options.source.empty() ? "live camera" : options.source)
                                                    : NameInputs(options.inputs);
  started.camera = camera;
  started.pinhole = camera.Ideal();
  started.pyramid = pyramid;
  started.vocabulary_hash = vocabulary.Hash();
  started.settings_json = ToJson(options);
  started.num_frames = num_frames;
  return started;
}

void WriteProfile(const std::string& path) {
  nlohmann::json json = nlohmann::json::array();
  std::cout << "stage                 frames  median ms   p95 ms  total s\n";
  for (const Profiler::Row& row : Profiler::Global().Table()) {
    json.push_back({{"stage", row.stage},
                    {"frames", row.frames},
                    {"median_ms", row.median_ms},
                    {"p95_ms", row.p95_ms},
                    {"total_s", row.total_s}});
    char line[120];
    std::snprintf(line, sizeof(line), "%-20s %7d %10.2f %8.2f %8.2f\n", row.stage.c_str(), row.frames, row.median_ms,
                  row.p95_ms, row.total_s);
    std::cout << line;
  }
  std::ofstream file(path);
  file << json.dump(1) << "\n";
  if (!file.flush()) throw std::runtime_error("profile " + path + ": cannot be written");
}

std::string ExplainNoFrame(const RunOptions& options, const Input& input) {
  if (options.mode != InputMode::kLive) return "input " + options.inputs.front() + ": no frame is left to be mapped";
  const std::string problem = input.News().empty() ? input.LastProblem() : input.News();
  if (input.NumBad() == 0) return "no image came on " + input.Name() + (problem.empty() ? "" : "; " + problem);
  return "none of " + std::to_string(input.NumBad()) + " images on " + input.Name() +
         " was good; the last: " + (problem.empty() ? "not an image_t" : problem);
}

// Waits until the store has everything. A link that is down comes back, sooner or later: what waits for it is told, and
// goes on waiting as long as it may; then the outbox keeps what is left. Throws std::runtime_error with one line.
void DeliverAll(const RunOptions& options, bool is_live, StreamSender* sender, HealthReporter* health) {
  if (is_live) WithdrawStopRequest();  // it has ended the flight; the next one ends the waiting
  auto last_progress = Clock::now();
  int64_t acknowledged = sender->AcknowledgedSeq();
  while (!sender->Flush(kTickMs)) {
    const int64_t now_acknowledged = sender->AcknowledgedSeq();
    if (now_acknowledged > acknowledged) last_progress = Clock::now();
    acknowledged = now_acknowledged;
    const int64_t num_left = sender->LastSeq() - acknowledged;
    const std::string obstacle = sender->Obstacle();
    const auto waited = Clock::now() - last_progress;
    const int64_t limit_ms = StopRequested()                 ? kStopTimeoutMs
                             : !sender->StoreError().empty() ? kRefusedTimeoutMs
                                                             : int64_t{1000} * options.deliver_timeout_s;
    if (waited > std::chrono::milliseconds(limit_ms)) {
      std::string problem = std::to_string(num_left) + " records were not stored (" + obstacle + ")";
      if (!options.outbox_path.empty())
        problem += "; they are kept in " + options.outbox_path + ": 'mapmend recover' on its folder delivers them";
      throw std::runtime_error(problem);
    }
    health->SetQueueDepth(static_cast<int>(num_left));
    if (waited > std::chrono::seconds(2))
      health->SetState("busy", std::to_string(num_left) + " records are still to be stored: " + obstacle);
    health->Tick();
  }
}

// Where a camera on board is heard.
std::string LocalUrl(const RunOptions& options) {
  return options.local_url.empty() ? ResolveLcmUrl(options.process.lcm_url) : options.local_url;
}

// One line for a person; empty if nothing was lost.
std::string DescribeDropped(int64_t num_dropped, int64_t num_bad) {
  std::string text;
  if (num_dropped > 0) text = std::to_string(num_dropped) + " frames came while the frontend was busy and were dropped";
  if (num_bad > 0) text += (text.empty() ? "" : "; ") + std::to_string(num_bad) + " images were refused";
  return text;
}

Camera ScaledToFit(const Camera& camera, int max_dimension) {
  const int dimension = std::max(camera.width, camera.height);
  const bool fits = max_dimension <= 0 || dimension <= max_dimension;
  return fits ? camera : camera.Scaled(max_dimension / static_cast<double>(dimension));
}

OrbOptions OrbFor(const RunOptions& options, const Camera& camera) {
  OrbOptions orb = options.orb;
  orb.num_features = options.num_features;
  if (orb.num_features == 0) orb.num_features = camera.width * camera.height <= 1000000 ? 1000 : 2000;
  if (const std::string error = orb.Check(); !error.empty()) throw std::runtime_error(error);
  return orb;
}

std::shared_ptr<const cv::Mat> MaskFor(const RunOptions& options, const Camera& camera) {
  if (options.mask_path.empty()) return nullptr;
  return std::make_shared<cv::Mat>(ReadMask(options.mask_path, camera.width, camera.height));
}

PositionInput PositionsFor(const RunOptions& options) {
  const std::vector<std::string> images =
      options.mode == InputMode::kLive ? std::vector<std::string>() : ImagesOf(options.inputs);
  PositionSource source = PositionSource::Open(options.gps_path, options.gps_origin, options.inputs, images);
  if (!source.Note().empty()) spdlog::info("frontend: {}", source.Note());
  const bool is_live = options.mode == InputMode::kLive && options.gps_path.empty();
  return {std::move(source),
          is_live ? std::make_unique<LivePositions>(LocalUrl(options), options.process.channel_prefix) : nullptr};
}

std::string SessionFor(const RunOptions& options) {
  if (!options.session.empty()) return options.session;
  return options.mode == InputMode::kLive ? NewSessionId() : SessionForFile(options);
}

FrontendOptions FrontendOptionsFor(const RunOptions& options) {
  FrontendOptions frontend = options.frontend;
  frontend.starter.initializer.seed = frontend.tracker.seed = frontend.sparse.pairs.seed = options.seed;
  frontend.mapping_thread = options.mode != InputMode::kLockstep;
  return frontend;
}

StreamSenderOptions SenderOptionsFor(const RunOptions& options) {
  StreamSenderOptions sender = options.sender;
  sender.outbox_path = options.outbox_path;
  return sender;
}

Pyramid PyramidOf(const OrbOptions& orb) { return {orb.scale_factor, orb.num_levels}; }

// One run of the frontend: input, tracking, the stream to the store, what people are told.
class FrontendRun {
 public:
  FrontendRun(const RunOptions& options, std::unique_ptr<ImageSource> file);
  // Returns the process's exit code.
  int Run();

 private:
  void OnFrame(const FramePtr& frame);
  void TellPositions(int64_t utime, std::vector<PositionFix> fixes);
  void TrackAll();
  void Finish();
  void Report();
  void ReportSource();
  int ExitCode();
  // Frames of this session before this frontend.
  int NumBefore() const { return is_live_ ? resume_.last_frame + 1 : input_->NumPassed(); }

  const RunOptions options_;
  const bool is_live_;
  const Camera input_camera_, camera_;
  const Vocabulary vocabulary_;
  const OrbOptions orb_;
  const bool wants_wide_;
  const std::string session_;
  Bus bus_;
  std::unique_ptr<Bus> local_bus_;
  HealthReporter health_;
  KeyframeImages images_;  // before who gives it images
  const FrameMaker maker_;
  StreamSender sender_;
  Frontend frontend_;
  EventLog events_;
  FlightDiary diary_;
  ResumePoint resume_;
  std::unique_ptr<ImageSource> file_;  // until there is an input
  std::unique_ptr<Input> input_;
  PositionInput positions_;

  const std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  std::vector<double> track_ms_;
  int num_frames_ = 0;
  int64_t last_utime_ = 0, num_unseen_ = 0;
};

FrontendRun::FrontendRun(const RunOptions& options, std::unique_ptr<ImageSource> file)
    : options_(options),
      is_live_(options.mode == InputMode::kLive),
      input_camera_(InputCamera(options, file.get())),
      camera_(ScaledToFit(input_camera_, options.max_dimension)),
      vocabulary_(Vocabulary::Read(options.vocabulary_path)),
      orb_(OrbFor(options, camera_)),
      wants_wide_(options.frontend.wide.num_keyframes > 0 && !options.frontend.relocalise_only),
      session_(SessionFor(options)),
      bus_(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix),
      local_bus_(options.local_url.empty() ? nullptr
                                           : std::make_unique<Bus>(options.local_url, options.process.channel_prefix)),
      health_(&bus_, "frontend"),
      images_(options, session_),
      maker_(input_camera_, camera_, orb_, MaskFor(options, camera_), wants_wide_, images_.AreKept()),
      sender_(&bus_, session_, SenderOptionsFor(options)),
      frontend_(FrontendOptionsFor(options), camera_.Ideal(), PyramidOf(orb_), &vocabulary_,
                [this](int64_t utime, RecordBody body) { sender_.Append(utime, std::move(body)); }),
      events_(options.events_path, "frontend"),
      diary_(&events_, &health_),
      file_(std::move(file)),
      positions_(PositionsFor(options)) {
  if (local_bus_) health_.AlsoTo(local_bus_.get());
  if (images_.AreKept()) {
    frontend_.TakeImages([this](KeyframeId keyframe, const Frame& frame) {
      images_.Take(keyframe, frame.index, frame.utime, frame.original.Get());
    });
  }
  if (!wants_wide_) return;
  cv::setNumThreads(1);  // threads of OpenCV's own would take the cores that tracking needs
  frontend_.ExtractWideFeatures(
      [this](const cv::Mat& image) { return maker_.ExtractWide(image, options_.frontend.wide.extraction); });
  frontend_.ConvertSparsePhotos(
      [this](const FramePtr& photo) { return maker_.WithWideFeatures(photo, options_.frontend.sparse.extraction); });
}

int FrontendRun::Run() {
  resume_ = FindResumePoint(options_, session_, &sender_, &health_);
  if (resume_.ended) {
    health_.SetCursor(session_, sender_.LastSeq());
    health_.SetState("done", "session " + session_ + " is complete already");
    return 0;
  }
  if (resume_.is_resumed) {
    frontend_.ContinueAfter(resume_.ids);
    positions_.PassOver(resume_.last_utime);
  }
  EndOpenSubmap(resume_, &sender_);
  last_utime_ = resume_.last_utime;
  images_.LookForLost(is_live_ || !resume_.is_resumed ? "" : session_, options_.continues);
  input_ = std::make_unique<Input>(options_, input_camera_, std::move(file_), resume_,
                                   [this](const SourceImage& image) { images_.OnPassed(image); });
  health_.SetCounter("frames_total", input_->FramesHint());
  health_.SetCounter("live", is_live_);
  health_.SetState(is_live_ ? "ready" : "busy", is_live_ ? "waits for images on " + input_->Name() : "");
  TrackAll();
  Finish();
  return ExitCode();
}

void FrontendRun::TrackAll() {
  FrameQueue queue(input_->Stream(), &maker_, options_.mode == InputMode::kLockstep ? 3 : 1);
  while (!StopRequested()) {
    const FramePtr frame = queue.Next(kTickMs);
    if (!frame && queue.HasEnded()) break;
    if (frame) OnFrame(frame);
    Report();
    health_.Tick();
  }
}

void FrontendRun::OnFrame(const FramePtr& frame) {
  if (num_frames_++ == 0) {
    const SessionStarted started =
        DescribeSession(options_, camera_, PyramidOf(orb_), vocabulary_, input_->NumFrames());
    diary_.OnStart(session_, started.source, camera_.width, camera_.height);
    if (!resume_.is_resumed) sender_.Append(frame->utime, started);
  }
  last_utime_ = frame->utime;
  TellPositions(frame->utime, positions_.TakeFor(frame->index, frame->utime));
  num_unseen_ += frame->num_unseen;
  if (num_frames_ == 1) images_.PassedAll();
  const FrameOutcome outcome = frontend_.ProcessFrame(frame);
  // Other frames may begin a submap later.
  if (outcome.state != FrontendState::kTracking) images_.Wait(frame);
  if (outcome.state == FrontendState::kTracking && !outcome.keyframe) frame->original.LetGo();
  track_ms_.push_back(1e3 * outcome.tracking_s);
  bus_.Publish(channels::kFramePose, PoseOf(session_, *frame, outcome));
  spdlog::debug("frame {}: {} {} {} inliers{}; {} features, brightness {:.0f}, sharpness {:.1f}", frame->index,
                ToString(outcome.method), ToString(outcome.cause), outcome.num_inliers,
                outcome.keyframe ? ", keyframe" : "", frame->features.Size(), frame->mean_brightness, frame->sharpness);
  diary_.OnFrame(*frame, outcome);
  if (const std::string error = sender_.StoreError(); !error.empty() && num_frames_ % 100 == 1) {
    spdlog::warn("the submap store cannot write: {}; buffering", error);
  }
}

void FrontendRun::TellPositions(int64_t utime, std::vector<PositionFix> fixes) {
  constexpr size_t kAtOnce = 1000;  // a message of 80 KB
  for (size_t i = 0; i < fixes.size(); i += kAtOnce) {
    const auto begin = fixes.begin() + static_cast<long>(i);
    sender_.Append(utime, PositionsRecord{{begin, begin + static_cast<long>(std::min(kAtOnce, fixes.size() - i))}});
  }
}

void FrontendRun::Report() {
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  health_.SetCounter("frames", NumBefore() + num_frames_);
  health_.SetCounter("frames_dropped", static_cast<double>(input_->Stream()->NumDropped()));
  health_.SetCounter("frames_left_out", input_->NumLeftOut());
  health_.SetCounter("bad_messages", static_cast<double>(input_->NumBad()));
  health_.SetCounter("fps", num_frames_ / std::max(1e-3, seconds));
  health_.SetCounter("tracked", frontend_.NumTracked());
  health_.SetCounter("submaps", frontend_.NumSubmaps());
  health_.SetCounter("keyframes", frontend_.NumKeyframes());
  health_.SetCounter("losses", frontend_.NumLosses());
  if (positions_.NumTold() > 0) health_.SetCounter("positions", static_cast<double>(positions_.NumTold()));
  if (positions_.NumBad() > 0) health_.SetCounter("positions_refused", static_cast<double>(positions_.NumBad()));
  health_.SetCursor(session_, sender_.LastSeq());
  health_.SetQueueDepth(static_cast<int>(sender_.LastSeq() - sender_.AcknowledgedSeq()));
  ReportSource();
}

void FrontendRun::ReportSource() {
  health_.SetCounter("source_news", static_cast<double>(input_->NumNews()));
  const std::string news = input_->News(), problem = input_->LastProblem();
  if (!news.empty() || !problem.empty()) {
    health_.SetState(num_frames_ > 0 ? "busy" : "ready", !news.empty() ? news : "images are refused: " + problem);
  } else if (num_frames_ > 0) {
    health_.SetState("busy");
  }
}

void FrontendRun::Finish() {
  // To be stopped is how a live flight ends.
  const bool cut_off = StopRequested() && !is_live_;
  const bool goes_on = resume_.is_resumed || !options_.continues.empty();
  if (num_frames_ == 0 && !cut_off && !goes_on) throw std::runtime_error(ExplainNoFrame(options_, *input_));
  diary_.OnFinished(frontend_.Finish(cut_off));  // who asked for it does not wait long
  if (num_frames_ > 0 && !cut_off) TellPositions(last_utime_, positions_.TakeRest());
  if (num_frames_ > 0 || resume_.is_resumed) sender_.Append(last_utime_, SessionEnded{NumBefore() + num_frames_});
  diary_.OnEnd(NumBefore() + num_frames_, frontend_.NumTracked(), input_->Stream()->NumDropped());
  Report();
  health_.SetCounter("track_ms_median", Percentile(track_ms_, 0.5));
  health_.SetCounter("track_ms_p95", Percentile(track_ms_, 0.95));
  health_.Tick();
  DeliverAll(options_, is_live_, &sender_, &health_);
  images_.Finish(&health_);
  Report();
}

int FrontendRun::ExitCode() {
  if (!options_.profile_path.empty()) WriteProfile(options_.profile_path);
  if (num_unseen_ > 0)
    spdlog::info("frontend: {} features lay where the lens model has no inverse and were left out", num_unseen_);
  const std::string dropped = DescribeDropped(input_->Stream()->NumDropped(), input_->NumBad());
  if (!dropped.empty()) spdlog::warn("{}", dropped);
  const std::string problem = input_->Problem();
  health_.SetState("done", problem.empty() ? dropped : problem);
  if (problem.empty()) return 0;
  input_->LogLeftOut();
  spdlog::error("{}", problem);
  return kExitPartOfInput;
}

}  // namespace

int RunFrontend(const RunOptions& options) {
  if (!options.profile_path.empty()) Profiler::Global().Enable();
  CheckInput(options);
  return FrontendRun(options, OpenFiles(options)).Run();
}

}  // namespace mapmend

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <mapmend/frame_pose_t.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "libs/base/stop_request.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/capture/device_images.h"
#include "libs/capture/follow_folder.h"
#include "libs/capture/image_mask.h"
#include "libs/capture/image_source.h"
#include "libs/capture/paced_images.h"
#include "libs/geometry/camera_file.h"
#include "libs/image_messages/image_log.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/stream/session_id.h"
#include "libs/wire/stream_sender.h"
#include "procs/frontend/flight_diary.h"
#include "procs/frontend/frame_queue.h"
#include "procs/frontend/live_images.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/resume.h"
#include "procs/frontend/resumed_images.h"
#include "procs/frontend/run_options.h"

namespace mapmend {
namespace {

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

void CheckInput(const RunOptions& options) {
  const auto refuse = [](bool given, const char* what) {
    if (given) throw std::runtime_error(std::string(what) + " does not go with --live");
  };
  if (options.mode == InputMode::kLive) {
    refuse(!options.inputs.empty(), "an input file");
    refuse(!options.times_path.empty(), "--times");
    refuse(!options.skip_frames.empty(), "--skip-frames");
  } else if (options.inputs.empty()) {
    throw std::runtime_error("no input: give a video file or a folder of images, or --live");
  }
}

std::unique_ptr<LiveStream> OpenLive(const RunOptions& options, const Camera& camera) {
  if (options.source.empty()) {
    return std::make_unique<LiveImages>(
        options.local_url.empty() ? ResolveLcmUrl(options.process.lcm_url) : options.local_url,
        options.process.channel_prefix, options.image_channel, camera.width, camera.height, options.max_waiting);
  }
  if (!DeviceImages::IsDevice(options.source))
    return std::make_unique<FollowFolder>(options.source, camera.width, camera.height);
  return std::make_unique<DeviceImages>(options.source, camera.width, camera.height, options.max_waiting,
                                        [](const std::string& line) { spdlog::info("{}", line); });
}

// The images of one run: files, in real time or not, or a camera.
class Input {
 public:
  // file: null for a camera.
  Input(const RunOptions& options, const Camera& camera, std::unique_ptr<ImageSource> file, const ResumePoint& resume)
      : file_(std::move(file)) {
    if (!file_) live_ = OpenLive(options, camera);
    base_ = live_ ? static_cast<ImageStream*>(live_.get()) : file_.get();
    if (resume.is_resumed || options.first_frame > 0) {
      resumed_ = std::make_unique<ResumedImages>(
          base_, ResumedImages::Start{live_ != nullptr, options.first_frame, resume.last_frame, resume.last_utime});
      base_ = resumed_.get();
    }
    if (options.mode == InputMode::kRealtime)
      paced_ = std::make_unique<PacedImages>(base_, options.speed, options.max_waiting);
  }
  ImageStream* Stream() const { return paced_ ? paced_.get() : base_; }
  int NumFrames() const { return file_ ? file_->NumFrames() : 0; }  // 0: nobody knows
  int NumPassed() const { return resumed_ ? resumed_->NumPassed() : 0; }
  int FramesHint() const { return file_ ? file_->FramesHint() : 0; }
  int NumLeftOut() const { return file_ ? file_->GetLeftOut().Count() : 0; }
  int64_t NumBad() const { return live_ ? live_->NumBad() : 0; }
  std::string LastProblem() const { return live_ ? live_->LastProblem() : ""; }
  std::string News() const { return live_ ? live_->News() : ""; }
  int64_t NumNews() const { return live_ ? live_->NumNews() : 0; }
  std::string Name() const { return live_ ? live_->Name() : ""; }
  std::string Problem() const { return file_ ? file_->Problem() : ""; }
  void LogLeftOut() const {
    if (!file_) return;
    for (const std::string& sentence : file_->GetLeftOut().Sentences()) spdlog::warn("left out: {}", sentence);
  }

 private:
  std::unique_ptr<LiveStream> live_;
  std::unique_ptr<ImageSource> file_;
  std::unique_ptr<ResumedImages> resumed_;  // reads one of them
  ImageStream* base_ = nullptr;             // the last of these three
  std::unique_ptr<PacedImages> paced_;      // reads base_
};

std::unique_ptr<ImageSource> OpenFiles(const RunOptions& options, const Camera& camera) {
  SourceOptions source;
  source.inputs = options.inputs;
  source.open_other = LogOpener(options.image_channel);
  source.times_path = options.times_path;
  source.camera_fps = camera.fps;
  source.skip = ParseFrameRanges(options.skip_frames);
  source.every = options.every;
  source.start_s = options.start_s;
  source.end_s = options.end_s;
  return std::make_unique<ImageSource>(source);
}

// The calibration for images of this size.
Camera FitCamera(const RunOptions& options, int width, int height) {
  const CameraFile file = ReadCameraFor(options.camera_path, width, height);
  for (const std::string& note : file.notes) spdlog::info("frontend: {}", note);
  return file.camera;
}

// The camera as the images of the input need it: most of them tell the size.
//   file  null for a camera, whose file must tell it
Camera InputCamera(const RunOptions& options, const Camera& given, const ImageSource* file) {
  if (file == nullptr) {
    if (given.width > 0) return FitCamera(options, given.width, given.height);
    throw std::runtime_error("camera file " + options.camera_path +
                             ": does not say width and height, which --live needs");
  }
  const auto [width, height] = file->UsualSize();
  if (width == 0) throw std::runtime_error("input " + options.inputs.front() + ": holds no readable frame");
  return FitCamera(options, width, height);
}

frame_pose_t ToMessage(const std::string& session, const Frame& frame, const FrameOutcome& outcome) {
  frame_pose_t message;
  message.session = session;
  message.utime = frame.utime;
  message.frame = frame.index;
  const bool tracked = outcome.state == FrontendState::kTracking;
  message.submap = tracked ? outcome.submap.value : -1;
  message.state = tracked ? "tracking" : outcome.state == FrontendState::kLost ? "lost" : "initialising";
  const auto pose = ToArray(outcome.cam_from_submap);
  std::copy(pose.begin(), pose.end(), message.cam_from_submap);
  message.num_inliers = outcome.num_inliers;
  return message;
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
  using Clock = std::chrono::steady_clock;
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
      const std::string kept = options.outbox_path.empty() ? ""
                                                           : "; they are kept in " + options.outbox_path +
                                                                 ": 'mapmend recover' on its folder delivers them";
      throw std::runtime_error(std::to_string(num_left) + " records were not stored (" + obstacle + ")" + kept);
    }
    health->SetQueueDepth(static_cast<int>(num_left));
    if (waited > std::chrono::seconds(2))
      health->SetState("busy", std::to_string(num_left) + " records are still to be stored: " + obstacle);
    health->Tick();
  }
}

// One line for a person; empty if nothing was lost.
std::string DescribeDropped(int64_t num_dropped, int64_t num_bad) {
  std::string text;
  if (num_dropped > 0) text = std::to_string(num_dropped) + " frames came while the frontend was busy and were dropped";
  if (num_bad > 0) text += (text.empty() ? "" : "; ") + std::to_string(num_bad) + " images were refused";
  return text;
}

}  // namespace

int RunFrontend(const RunOptions& options) {
  if (!options.profile_path.empty()) Profiler::Global().Enable();
  CheckInput(options);
  const bool is_live = options.mode == InputMode::kLive;
  const Camera given_camera = ReadCamera(options.camera_path);
  std::unique_ptr<ImageSource> file;
  if (!is_live) file = OpenFiles(options, given_camera);
  const Camera input_camera = InputCamera(options, given_camera, file.get());
  Camera camera = input_camera;
  const int dimension = std::max(camera.width, camera.height);
  if (options.max_dimension > 0 && dimension > options.max_dimension)
    camera = camera.Scaled(options.max_dimension / static_cast<double>(dimension));
  const Vocabulary vocabulary = Vocabulary::Read(options.vocabulary_path);
  OrbOptions orb;
  orb.num_features = options.num_features;
  if (orb.num_features == 0) orb.num_features = camera.width * camera.height <= 1000000 ? 1000 : 2000;
  orb.Check();
  std::shared_ptr<const cv::Mat> mask;
  if (!options.mask_path.empty())
    mask = std::make_shared<cv::Mat>(ReadMask(options.mask_path, camera.width, camera.height));
  const FrameMaker maker(input_camera, camera, orb, mask);
  const std::string session = !options.session.empty() ? options.session
                              : is_live                ? NewSessionId()
                                                       : SessionForFile(options);

  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  std::unique_ptr<Bus> local_bus;
  if (!options.local_url.empty()) local_bus = std::make_unique<Bus>(options.local_url, options.process.channel_prefix);
  HealthReporter health(&bus, "frontend");
  if (local_bus) health.AlsoTo(local_bus.get());
  StreamSenderOptions sender_options;
  sender_options.outbox_path = options.outbox_path;
  StreamSender sender(&bus, session, sender_options);
  FrontendOptions frontend_options = options.frontend;
  frontend_options.initializer.seed = frontend_options.tracker.seed = options.seed;
  frontend_options.mapping_thread = options.mode != InputMode::kLockstep;
  const Pyramid pyramid{orb.scale_factor, orb.num_levels};
  Frontend frontend(frontend_options, camera.Ideal(), pyramid, &vocabulary,
                    [&](int64_t utime, RecordBody body) { sender.Append(utime, std::move(body)); });

  const ResumePoint resume = FindResumePoint(options, session, &sender, &health);
  if (resume.ended) {
    health.SetCursor(session, sender.LastSeq());
    health.SetState("done", "session " + session + " is complete already");
    return 0;
  }
  if (resume.is_resumed) frontend.ContinueAfter(resume.ids);
  EndOpenSubmap(resume, &sender);
  EventLog events(options.events_path, "frontend");
  FlightDiary diary(&events, &health);

  // Last of all: a camera or a clock does not wait.
  const Input input(options, input_camera, std::move(file), resume);
  // Of this session, before this frontend.
  const auto num_before = [&] { return is_live ? resume.last_frame + 1 : input.NumPassed(); };
  FrameQueue queue(input.Stream(), &maker, options.mode == InputMode::kLockstep ? 3 : 1);
  health.SetCounter("frames_total", input.FramesHint());
  health.SetCounter("live", is_live);
  health.SetState(is_live ? "ready" : "busy", is_live ? "waits for images on " + input.Name() : "");
  std::vector<double> track_ms;
  const auto begin = std::chrono::steady_clock::now();
  int num_frames = 0;
  int64_t last_utime = resume.last_utime, num_unseen = 0;
  const auto report = [&] {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    health.SetCounter("frames", num_before() + num_frames);
    health.SetCounter("frames_dropped", static_cast<double>(input.Stream()->NumDropped()));
    health.SetCounter("frames_left_out", input.NumLeftOut());
    health.SetCounter("bad_messages", static_cast<double>(input.NumBad()));
    health.SetCounter("fps", num_frames / std::max(1e-3, seconds));
    health.SetCounter("tracked", frontend.NumTracked());
    health.SetCounter("submaps", frontend.NumSubmaps());
    health.SetCounter("keyframes", frontend.NumKeyframes());
    health.SetCounter("losses", frontend.NumLosses());
    health.SetCursor(session, sender.LastSeq());
    health.SetQueueDepth(static_cast<int>(sender.LastSeq() - sender.AcknowledgedSeq()));
    health.SetCounter("source_news", static_cast<double>(input.NumNews()));
    const std::string news = input.News();
    if (const std::string problem = input.LastProblem(); !news.empty() || !problem.empty()) {
      health.SetState(num_frames > 0 ? "busy" : "ready", !news.empty() ? news : "images are refused: " + problem);
    } else if (num_frames > 0) {
      health.SetState("busy");
    }
  };
  while (!StopRequested()) {
    const FramePtr frame = queue.Next(kTickMs);
    if (!frame) {
      if (queue.HasEnded()) break;
      report();
      health.Tick();
      continue;
    }
    if (num_frames++ == 0) {
      const SessionStarted started = DescribeSession(options, camera, pyramid, vocabulary, input.NumFrames());
      diary.OnStart(session, started.source, camera.width, camera.height);
      if (!resume.is_resumed) sender.Append(frame->utime, started);
    }
    last_utime = frame->utime;
    num_unseen += frame->num_unseen;
    const FrameOutcome outcome = frontend.ProcessFrame(frame);
    track_ms.push_back(1e3 * outcome.tracking_s);
    bus.Publish(channels::kFramePose, ToMessage(session, *frame, outcome));
    spdlog::debug("frame {}: {} {} {} inliers{}; {} features, brightness {:.0f}, sharpness {:.1f}", frame->index,
                  ToString(outcome.method), ToString(outcome.cause), outcome.num_inliers,
                  outcome.keyframe ? ", keyframe" : "", frame->features.Size(), frame->mean_brightness,
                  frame->sharpness);
    diary.OnFrame(*frame, outcome);
    report();
    health.Tick();
    if (const std::string error = sender.StoreError(); !error.empty() && num_frames % 100 == 1) {
      spdlog::warn("the submap store cannot write: {}; buffering", error);
    }
  }
  // To be stopped is how a live flight ends.
  const bool cut_off = StopRequested() && !is_live;
  const bool goes_on = resume.is_resumed || !options.continues.empty();
  if (num_frames == 0 && !cut_off && !goes_on) throw std::runtime_error(ExplainNoFrame(options, input));
  frontend.Finish();
  if (num_frames > 0 || resume.is_resumed) sender.Append(last_utime, SessionEnded{num_before() + num_frames});
  diary.OnEnd(num_before() + num_frames, frontend.NumTracked(), input.Stream()->NumDropped());
  report();
  health.SetCounter("track_ms_median", Percentile(track_ms, 0.5));
  health.SetCounter("track_ms_p95", Percentile(track_ms, 0.95));
  health.Tick();
  DeliverAll(options, is_live, &sender, &health);
  report();
  if (!options.profile_path.empty()) WriteProfile(options.profile_path);
  if (num_unseen > 0)
    spdlog::info("frontend: {} features lay where the lens model has no inverse and were left out", num_unseen);
  const std::string dropped = DescribeDropped(input.Stream()->NumDropped(), input.NumBad());
  if (!dropped.empty()) spdlog::warn("{}", dropped);
  const std::string problem = input.Problem();
  health.SetState("done", problem.empty() ? dropped : problem);
  if (!problem.empty()) {
    input.LogLeftOut();
    spdlog::error("{}", problem);
    return kExitPartOfInput;
  }
  return 0;
}

}  // namespace mapmend

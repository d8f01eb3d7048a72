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
#include <opencv2/videoio.hpp>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/bus/stream_sender.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/frontend/frame_queue.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/run_options.h"

namespace mapmend {
namespace {

constexpr int kExitTruncatedInput = 3;
constexpr int kFlushTimeoutMs = 20000, kStopFlushTimeoutMs = 1500;  // without progress; asked to stop, the store may be gone

double Percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<long>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// A calibration file need not say the size of the images: then the first one does.
Camera WithImageSize(Camera camera, const RunOptions& options, const std::set<int>& skip) {
  if (camera.width > 0 && camera.height > 0) return camera;
  ImageSource source(options.input, "", camera.fps, skip);
  const auto image = source.Next();
  if (!image) throw std::runtime_error("input " + options.input + ": holds no readable frame");
  camera.width = image->pixels->cols;
  camera.height = image->pixels->rows;
  return camera;
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

SessionStarted DescribeSession(const RunOptions& options, const Camera& camera, const Pyramid& pyramid,
                               const Vocabulary& vocabulary, int num_frames) {
  SessionStarted started;
  started.version = MAPMEND_VERSION;
  started.vehicle = options.vehicle;
  started.source = std::filesystem::path(options.input).filename().string();
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
    json.push_back({{"stage", row.stage}, {"frames", row.frames}, {"median_ms", row.median_ms}, {"p95_ms", row.p95_ms}, {"total_s", row.total_s}});
    char line[120];
    std::snprintf(line, sizeof(line), "%-20s %7d %10.2f %8.2f %8.2f\n", row.stage.c_str(), row.frames, row.median_ms, row.p95_ms, row.total_s);
    std::cout << line;
  }
  std::ofstream file(path);
  file << json.dump(1) << "\n";
  if (!file.flush()) throw std::runtime_error("profile " + path + ": cannot be written");
}

}  // namespace

int RunFrontend(const RunOptions& options) {
  if (!options.profile_path.empty()) Profiler::Global().Enable();
  const std::set<int> skip = ParseFrameRanges(options.skip_frames);
  Camera camera = WithImageSize(ReadCamera(options.camera_path), options, skip);
  double scale = 1.0;
  if (options.max_dimension > 0) scale = std::min(1.0, options.max_dimension / static_cast<double>(std::max(camera.width, camera.height)));
  if (scale < 1.0) camera = camera.Scaled(scale);
  ImageSource source(options.input, options.times_path, camera.fps, skip);
  const Vocabulary vocabulary = Vocabulary::Read(options.vocabulary_path);
  OrbOptions orb;
  orb.num_features = options.num_features;
  if (orb.num_features == 0) orb.num_features = camera.width * camera.height <= 1000000 ? 1000 : 2000;
  orb.Check();
  const FrameMaker maker(camera, scale, orb);
  const std::string session = options.session.empty() ? SessionForFile(options) : options.session;

  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  HealthReporter health(&bus, "frontend");
  StreamSenderOptions sender_options;
  sender_options.outbox_path = options.outbox_path;
  StreamSender sender(&bus, session, sender_options);
  FrontendOptions frontend_options = options.frontend;
  frontend_options.initializer.seed = frontend_options.tracker.seed = options.seed;
  const Pyramid pyramid{orb.scale_factor, orb.num_levels};
  Frontend frontend(frontend_options, camera.Ideal(), pyramid, &vocabulary,
                    [&](int64_t utime, RecordBody body) { sender.Append(utime, std::move(body)); });

  FrameQueue queue(&source, &maker);
  health.SetCounter("frames_total", source.NumFrames());
  health.SetState("busy");
  std::vector<double> track_ms;
  const auto begin = std::chrono::steady_clock::now();
  int num_frames = 0;
  int64_t last_utime = 0;
  const auto report = [&] {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    health.SetCounter("frames", num_frames);
    health.SetCounter("fps", num_frames / std::max(1e-3, seconds));
    health.SetCounter("tracked", frontend.NumTracked());
    health.SetCounter("submaps", frontend.NumSubmaps());
    health.SetCounter("keyframes", frontend.NumKeyframes());
    health.SetCounter("losses", frontend.NumLosses());
    health.SetCursor(session, sender.LastSeq());
    health.SetQueueDepth(static_cast<int>(sender.LastSeq() - sender.AcknowledgedSeq()));
  };
  while (!StopRequested()) {
    const FramePtr frame = queue.Next();
    if (!frame) break;
    if (num_frames++ == 0) {
      sender.Append(frame->utime, DescribeSession(options, camera, pyramid, vocabulary, source.NumFrames()));
    }
    last_utime = frame->utime;
    const FrameOutcome outcome = frontend.ProcessFrame(frame);
    track_ms.push_back(1e3 * outcome.tracking_s);
    bus.Publish(channels::kFramePose, ToMessage(session, *frame, outcome));
    spdlog::debug("frame {}: {} {} {} inliers{}", frame->index, outcome.method, outcome.reason, outcome.num_inliers,
                  outcome.keyframe ? ", keyframe" : "");
    report();
    health.Tick();
    if (const std::string error = sender.StoreError(); !error.empty() && num_frames % 100 == 1) {
      spdlog::warn("the submap store cannot write: {}; buffering", error);
    }
  }
  if (num_frames == 0 && !StopRequested()) throw std::runtime_error("input " + options.input + ": holds no readable frame");
  frontend.Finish();
  if (num_frames > 0) sender.Append(last_utime, SessionEnded{num_frames});
  report();
  health.SetCounter("track_ms_median", Percentile(track_ms, 0.5));
  health.SetCounter("track_ms_p95", Percentile(track_ms, 0.95));
  health.Tick();
  if (!sender.Flush(StopRequested() ? kStopFlushTimeoutMs : kFlushTimeoutMs)) {
    const std::string why = sender.StoreError().empty() ? "the submap store does not answer" : sender.StoreError();
    throw std::runtime_error(std::to_string(sender.LastSeq() - sender.AcknowledgedSeq()) + " records were not stored (" + why + ")" +
                             (options.outbox_path.empty() ? "" : "; they are kept in " + options.outbox_path));
  }
  report();
  if (!options.profile_path.empty()) WriteProfile(options.profile_path);
  health.SetState("done", source.Truncated());
  if (!source.Truncated().empty()) {
    spdlog::error("{}", source.Truncated());
    return kExitTruncatedInput;
  }
  return 0;
}

}  // namespace mapmend

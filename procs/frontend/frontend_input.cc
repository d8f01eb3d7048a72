#include "procs/frontend/frontend_input.h"

#include <spdlog/spdlog.h>

#include <stdexcept>
#include <utility>

#include "libs/base/frame_ranges.h"
#include "libs/bus/bus.h"
#include "libs/capture/device_images.h"
#include "libs/capture/follow_folder.h"
#include "libs/geometry/camera_file.h"
#include "libs/image_messages/image_log.h"
#include "procs/frontend/live_images.h"

namespace mapmend {
namespace {

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

// The calibration for images of this size.
Camera FitCamera(const RunOptions& options, int width, int height) {
  const CameraFile file = ReadCameraFor(options.camera_path, width, height);
  for (const std::string& note : file.notes) spdlog::info("frontend: {}", note);
  return file.camera;
}

}  // namespace

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

std::unique_ptr<ImageSource> OpenFiles(const RunOptions& options) {
  if (options.mode == InputMode::kLive) return nullptr;
  SourceOptions source;
  source.inputs = options.inputs;
  source.open_other = LogOpener(options.image_channel);
  source.times_path = options.times_path;
  source.camera_fps = ReadCamera(options.camera_path).fps;
  source.skip = ParseFrameRanges(options.skip_frames);
  source.every = options.every;
  source.start_s = options.start_s;
  source.end_s = options.end_s;
  return std::make_unique<ImageSource>(source);
}

Camera InputCamera(const RunOptions& options, const ImageSource* file) {
  if (file == nullptr) {
    const Camera given = ReadCamera(options.camera_path);
    if (given.width > 0) return FitCamera(options, given.width, given.height);
    throw std::runtime_error("camera file " + options.camera_path +
                             ": does not say width and height, which --live needs");
  }
  const auto [width, height] = file->UsualSize();
  if (width == 0) throw std::runtime_error("input " + options.inputs.front() + ": holds no readable frame");
  return FitCamera(options, width, height);
}

Input::Input(const RunOptions& options, const Camera& camera, std::unique_ptr<ImageSource> file,
             const ResumePoint& resume, ResumedImages::OnPassed on_passed)
    : file_(std::move(file)) {
  if (!file_) live_ = OpenLive(options, camera);
  base_ = live_ ? static_cast<ImageStream*>(live_.get()) : file_.get();
  if (resume.is_resumed || options.first_frame > 0) {
    resumed_ = std::make_unique<ResumedImages>(
        base_, ResumedImages::Start{live_ != nullptr, options.first_frame, resume.last_frame, resume.last_utime},
        std::move(on_passed));
    base_ = resumed_.get();
  }
  if (options.mode == InputMode::kRealtime)
    paced_ = std::make_unique<PacedImages>(base_, options.speed, options.max_waiting);
}

void Input::LogLeftOut() const {
  if (!file_) return;
  for (const std::string& sentence : file_->GetLeftOut().Sentences()) spdlog::warn("left out: {}", sentence);
}

}  // namespace mapmend

// `mapmend publish`: plays a video or a folder of images onto the bus, as a camera process would.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <mapmend/image_t.hpp>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "libs/base/frame_ranges.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/process.h"
#include "libs/capture/image_source.h"
#include "libs/capture/times_beside.h"
#include "libs/command_line/command_line.h"
#include "libs/image_messages/image_log.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/health_monitor.h"
#include "procs/mapmend/run_flight.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kNumEndMessages = 6;  // three must arrive within a second; the channel may lose some

struct PublishOptions {
  std::vector<std::string> inputs;
  std::string times, skip_frames, image_channel, lcm_url, channel_prefix, format = "jpeg";
  double speed = 1;
  int quality = 95;
  bool no_wait = false, no_end = false;
};

image_t ToMessage(const SourceImage& image, const PublishOptions& options) {
  image_t message{};
  message.utime = image.utime;
  message.frame = image.index;
  message.width = image.pixels->cols;
  message.height = image.pixels->rows;
  if (options.format == "jpeg") {
    message.format = image_t::JPEG;
    cv::imencode(".jpg", *image.pixels, message.data, {cv::IMWRITE_JPEG_QUALITY, options.quality});
  } else {
    message.format = image_t::GREY8;
    cv::Mat grey = *image.pixels;
    if (grey.channels() == 3) cv::cvtColor(grey, grey, cv::COLOR_BGR2GRAY);
    if (grey.channels() == 4) cv::cvtColor(grey, grey, cv::COLOR_BGRA2GRAY);
    for (int y = 0; y < grey.rows; ++y) message.data.insert(message.data.end(), grey.ptr(y), grey.ptr(y) + grey.cols);
  }
  message.num_bytes = static_cast<int32_t>(message.data.size());
  return message;
}

// False if asked to stop meanwhile.
bool HandleUntil(Bus* bus, Clock::time_point due) {
  do {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - Clock::now()).count();
    bus->Handle(static_cast<int>(std::clamp<int64_t>(left, 0, 50)));
    if (StopRequested()) return false;
  } while (Clock::now() < due);
  return true;
}

bool WaitForFrontend(Bus* bus, const HealthMonitor& monitor, const std::string& url) {
  const auto is_ready = [&] {
    const HealthMonitor::Entry* frontend = monitor.FindLatest("frontend");
    return CounterOr(frontend, "live", 0) > 0 && (frontend->state == "ready" || frontend->state == "busy");
  };
  for (bool told = false; !is_ready(); told = true) {
    if (!told) std::printf("waiting for a frontend with --live on %s\n", url.c_str());
    std::fflush(stdout);
    if (!HandleUntil(bus, Clock::now() + std::chrono::milliseconds(100))) return false;
  }
  return true;
}

int Publish(PublishOptions options) {
  InstallSignalHandlers();
  options.inputs = ExpandLogs(options.inputs);
  const bool is_log = AreLogs(options.inputs);
  if (!is_log && !options.image_channel.empty()) throw UsageError("--image-channel needs a log of lcm-logger as INPUT");
  if (options.times.empty() && !is_log) options.times = FindTimesBeside(options.inputs).path;
  SourceOptions source_options;
  source_options.inputs = options.inputs;
  source_options.open_other = LogOpener(options.image_channel);
  source_options.times_path = options.times;
  source_options.skip = ParseFrameRanges(options.skip_frames);
  ImageSource source(source_options);
  for (const std::string& note : source.Notes()) std::printf("%s\n", note.c_str());
  const std::string url = ResolveLcmUrl(options.lcm_url);
  Bus bus(url, options.channel_prefix);
  const HealthMonitor monitor(&bus);
  if (!options.no_wait && !WaitForFrontend(&bus, monitor, url)) return kExitInterrupted;
  int num_sent = 0, num_lost = 0;
  std::optional<int64_t> first_utime;
  Clock::time_point start;
  while (const auto image = source.Next()) {
    const image_t message = ToMessage(*image, options);
    if (!first_utime) {
      first_utime = image->utime;
      start = Clock::now();
    }
    const std::chrono::duration<double, std::micro> due(static_cast<double>(image->utime - *first_utime) /
                                                        options.speed);
    if (!HandleUntil(&bus, start + std::chrono::duration_cast<Clock::duration>(due))) break;
    ++(bus.Publish(channels::kImage, message) ? num_sent : num_lost);
  }
  const bool interrupted = StopRequested();
  if (!options.no_end && !interrupted) {
    for (int i = 0; i < kNumEndMessages; ++i) {
      bus.Publish(channels::kImage, image_t{});
      HandleUntil(&bus, Clock::now() + std::chrono::milliseconds(50));
    }
  }
  std::printf("%d images published\n", num_sent);
  const std::string problem = source.Problem();
  if (!problem.empty()) std::fprintf(stderr, "mapmend: %s\n", problem.c_str());
  if (num_lost > 0) throw std::runtime_error(std::to_string(num_lost) + " images could not be sent: no hub on " + url);
  if (interrupted) return kExitInterrupted;
  return problem.empty() ? 0 : kExitInputCutShort;
}

}  // namespace

void AddPublishCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "publish", "Play a video or a folder of images onto the bus, as a camera would, for `mapmend run --live`");
  const auto options = std::make_shared<PublishOptions>();
  sub->add_option("INPUT", options->inputs,
                  "video file, folder of images taken in the order of their names, or log of lcm-logger with images; "
                  "several are parts of one flight")
      ->required();
  sub->add_option("--times", options->times,
                  "one time in seconds per line and frame (default: times.txt beside INPUT, else from the frame rate)");
  sub->add_option("--image-channel", options->image_channel,
                  "of an INPUT that is a log: the channel that holds its images (default: MAPMEND_IMAGE)");
  sub->add_option("--skip-frames", options->skip_frames, "frames to leave out, e.g. 80-120,200-240");
  sub->add_option("--speed", options->speed, "times as fast as the images were taken")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  sub->add_option("--format", options->format, "jpeg, or grey (8 bit, not compressed)")
      ->check(CLI::IsMember({"jpeg", "grey"}))
      ->capture_default_str();
  sub->add_option("--quality", options->quality, "of JPEG, 1 to 100")->check(CLI::Range(1, 100))->capture_default_str();
  sub->add_flag("--no-wait", options->no_wait, "begin at once, whether a frontend listens or not");
  sub->add_flag("--no-end", options->no_end, "do not end the flight after the last image: more will come");
  sub->add_option("--lcm-url", options->lcm_url, "LCM network (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700)");
  sub->add_option("--channel-prefix", options->channel_prefix,
                  "put before every channel name, so that runs can share a bus");
  sub->footer(
      "Exit codes: 0 done; 1 an error, told in one line; 2 a mistake in the command line; 3 INPUT ends early, or\n"
      "frames of it could not be used; 130 interrupted.");
  sub->callback([options] {
    const int code = Publish(*options);
    if (code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend

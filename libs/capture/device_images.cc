#include "libs/capture/device_images.h"

#include <gst/gst.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <utility>

#include "libs/capture/video_reader.h"

namespace mapmend {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr double kFirstPause = 0.2, kLongestPause = 5;  // seconds between attempts
constexpr double kNetworkTimeout = 5;                   // seconds without an image: the camera is gone

int64_t SystemUtime() {
  return std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string Pipeline(const std::string& source) {
  const std::string pipeline = source.substr(std::string("gst:").size());
  if (pipeline.find("appsink") != std::string::npos) return pipeline;
  return pipeline + " ! videoconvert ! video/x-raw,format=BGR ! appsink drop=true max-buffers=4 sync=false";
}

// Why GStreamer refuses a pipeline; empty: it does not. OpenCV would wait for a pipeline with unknown elements for
// ever.
std::string PipelineProblem(const std::string& pipeline) {
  GError* error = nullptr;
  if (!gst_init_check(nullptr, nullptr, nullptr)) return "GStreamer cannot be started";
  GstElement* element = gst_parse_launch_full(pipeline.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  const std::string problem = error != nullptr ? error->message : "";
  g_clear_error(&error);
  if (element != nullptr) gst_object_unref(element);
  return problem;
}

}  // namespace

class DeviceImages::Camera {
 public:
  virtual ~Camera() = default;
  // False if the camera is gone. utime: of the stream, from any start; nullopt: it does not say.
  virtual bool Read(cv::Mat* image, std::optional<int64_t>* utime) = 0;
};

class DeviceImages::Device : public Camera {
 public:
  explicit Device(const std::string& source) {
    setenv("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "5", 0);  // seconds; 10 are OpenCV's own
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    const bool is_pipeline = source.starts_with("gst:");
    std::string problem = is_pipeline ? PipelineProblem(Pipeline(source)) : "";
    if (problem.empty() &&
        !(is_pipeline ? capture_.open(Pipeline(source), cv::CAP_GSTREAMER) : capture_.open(source, cv::CAP_V4L2))) {
      problem = is_pipeline ? "the pipeline does not start" : "no such device, or no camera";
    }
    if (!problem.empty()) throw std::runtime_error("source " + source + " cannot be opened: " + problem);
  }
  bool Read(cv::Mat* image, std::optional<int64_t>* utime) override {
    if (!capture_.read(*image) || image->empty()) return false;
    const double ms = capture_.get(cv::CAP_PROP_POS_MSEC);
    if (ms > last_ms_) *utime = std::llround(ms * 1000);
    last_ms_ = ms;
    *image = image->clone();  // the device fills its buffer again
    return true;
  }

 private:
  cv::VideoCapture capture_;
  double last_ms_ = 0;
};

class DeviceImages::Network : public Camera {
 public:
  Network(const std::string& url, const std::atomic<bool>* stop) : reader_(url, kNetworkTimeout, stop) {}
  bool Read(cv::Mat* image, std::optional<int64_t>* utime) override {
    do {
      if (!reader_.Grab()) return false;
    } while (reader_.IsDamaged());
    *image = reader_.Pixels();
    *utime = reader_.Utime();
    return !image->empty();
  }

 private:
  VideoReader reader_;
};

bool DeviceImages::IsDevice(const std::string& source) {
  return source.starts_with("/dev/") || source.starts_with("gst:") || source.find("://") != std::string::npos;
}

DeviceImages::DeviceImages(const std::string& source, int width, int height, int max_waiting,
                           std::function<void(const std::string&)> tell)
    : source_(source),
      width_(width),
      height_(height),
      tell_(std::move(tell)),
      queue_(static_cast<size_t>(max_waiting)),
      begin_utime_(SystemUtime()),
      begin_(SteadyClock::now()) {
  thread_ = std::thread([this] { Run(); });
}

DeviceImages::~DeviceImages() {
  Stop();
  thread_.join();
}

std::unique_ptr<DeviceImages::Camera> DeviceImages::Open() {
  if (source_.find("://") != std::string::npos && !source_.starts_with("gst:"))
    return std::make_unique<Network>(source_, &stop_);
  return std::make_unique<Device>(source_);
}

void DeviceImages::Run() {
  double pause = kFirstPause;
  bool told = false;
  while (!stop_) {
    const int before = next_index_;
    std::string why = "source " + source_ + " has ended";
    try {
      const std::unique_ptr<Camera> camera = Open();
      Read(camera.get());
    } catch (const std::exception& e) {
      why = e.what();
    }
    if (stop_) break;
    if (next_index_ > before) {
      pause = kFirstPause;
      told = false;
    }
    if (!std::exchange(told, true)) {
      problems_.Tell(why + "; waits for it");
      tell_(why + "; waits for it");
    }
    if (!Wait(pause)) break;
    pause = std::min(2 * pause, kLongestPause);
  }
  queue_.Close();
}

void DeviceImages::Read(Camera* camera) {
  cv::Mat image;
  std::optional<int64_t> stream_utime;
  std::optional<int64_t> stream_begin;  // such that stream_begin + stream_utime is the time of the clock
  for (bool is_first = true; !stop_ && camera->Read(&image, &stream_utime); is_first = false) {
    if (is_first) {
      tell_("source " + source_ + ": images of " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
            " pixels come");
      problems_.Withdraw();
    }
    if (image.cols != width_ || image.rows != height_) {
      const std::string what = "image of " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                               " pixels, the camera file says " + std::to_string(width_) + " x " +
                               std::to_string(height_);
      if (problems_.Add(what) <= 10) tell_("image refused: " + what);
      continue;
    }
    const int64_t now =
        begin_utime_ + std::chrono::duration_cast<std::chrono::microseconds>(SteadyClock::now() - begin_).count();
    int64_t utime = now;
    if (stream_utime) {
      if (!stream_begin) stream_begin = now - *stream_utime;
      utime = *stream_begin + *stream_utime;
    }
    last_utime_ = std::max(utime, last_utime_ + 1);
    queue_.Push({next_index_++, last_utime_, std::make_shared<cv::Mat>(range_.To8Bit(image))});
    stream_utime.reset();
  }
}

bool DeviceImages::Wait(double seconds) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stop_.load(); });
}

void DeviceImages::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  queue_.Clear();
}

}  // namespace mapmend

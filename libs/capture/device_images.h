#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "libs/capture/latest_queue.h"
#include "libs/capture/live_stream.h"
#include "libs/capture/problems.h"
#include "libs/capture/steady_range.h"

namespace mapmend {

// A camera that this process reads itself:
//   /dev/video0                     V4L2
//   rtsp://..., and what else libavformat takes from a network (http, udp, tcp, srt, rtmp)
//   gst:PIPELINE                    GStreamer, e.g. gst:v4l2src ! jpegdec; an appsink is put at its end if it has none
// A camera that is not there, or goes away, is waited for: it is opened anew with growing pauses, up to 5 s. Reading
// has a thread of its own; the newest images wait to be taken, others are dropped and counted. Times are those of the
// stream, fixed to the clock when it begins; without any, those of the arrival.
class DeviceImages : public LiveStream {
 public:
  // True if the text names such a source.
  static bool IsDevice(const std::string& source);

  // width, height: of the camera, pixels; other images are refused.  max_waiting: images that may wait to be taken.
  // tell: gets lines for the log, from the reading thread.
  DeviceImages(const std::string& source, int width, int height, int max_waiting,
               std::function<void(const std::string&)> tell);
  ~DeviceImages() override;

  std::optional<SourceImage> Next() override { return queue_.Pop(); }
  void Stop() override;
  int64_t NumDropped() const override { return queue_.NumDropped(); }
  int64_t NumBad() const override { return problems_.Count(); }
  std::string LastProblem() const override { return problems_.Last(); }
  std::string News() const override { return problems_.News(); }
  int64_t NumNews() const override { return problems_.NumNews(); }
  std::string Name() const override { return "source " + source_; }

 private:
  class Camera;
  class Device;
  class Network;

  std::unique_ptr<Camera> Open();
  void Run();
  void Read(Camera* camera);
  bool Wait(double seconds);  // false after Stop

  const std::string source_;
  const int width_, height_;
  const std::function<void(const std::string&)> tell_;
  LatestQueue<SourceImage> queue_;
  Problems problems_;
  SteadyRange range_;
  // The wall clock may be set during the flight: it is asked once.
  const int64_t begin_utime_;
  const std::chrono::steady_clock::time_point begin_;
  int next_index_ = 0;
  int64_t last_utime_ = 0;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::thread thread_;
};

}  // namespace mapmend

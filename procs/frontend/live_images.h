#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "libs/bus/bus.h"
#include "libs/capture/image_stream.h"
#include "libs/capture/latest_queue.h"

namespace mapmend {

class image_t;

// Images that a camera process publishes on MAPMEND_IMAGE, until it says that no more come. Has a connection to the bus
// and a thread of its own, so that neither the camera nor the stream of records waits for the frontend: the newest
// images are kept, older ones that nobody took are dropped and counted. Messages that are no good are counted,
// remembered for the health message, and dropped.
class LiveImages : public ImageStream {
 public:
  // width, height: of the camera, pixels.  max_waiting: images that may wait to be taken.
  // Throws std::runtime_error as Bus does.
  LiveImages(const std::string& url, const std::string& channel_prefix, int width, int height, int max_waiting);
  ~LiveImages() override;

  std::optional<SourceImage> Next() override;
  void Stop() override;
  int64_t NumDropped() const override { return queue_.NumDropped(); }
  int64_t NumBad() const { return num_bad_ + bus_.NumRefused(); }
  std::string LastProblem() const;  // of the last bad message; empty: there was none

 private:
  struct Arrival {
    int index = -1;
    std::shared_ptr<image_t> message;
  };
  void Receive(const image_t& message);
  void Refuse(const std::string& problem);

  const int width_, height_;
  Bus bus_;
  LatestQueue<Arrival> queue_;
  int64_t last_utime_ = -1;  // of the receiving thread, as the next
  int last_index_ = -1;
  std::atomic<int64_t> num_bad_{0};
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;
  std::string last_problem_;
  Subscription subscription_;
  std::thread thread_;
};

}  // namespace mapmend

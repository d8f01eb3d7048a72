#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include "libs/bus/bus.h"
#include "libs/capture/image_order.h"
#include "libs/capture/latest_queue.h"
#include "libs/capture/live_stream.h"
#include "libs/capture/problems.h"
#include "procs/frontend/ends_of_stream.h"

namespace mapmend {

class image_t;

// Images that a camera process publishes on the bus, until it says that no more come. Has a connection to the bus and a
// thread of its own, so that neither the camera nor the stream of records waits for the frontend: the newest images are
// kept, older ones that nobody took are dropped and counted. Messages that are no good, or not of this camera, are
// counted, remembered for the health message, and dropped.
class LiveImages : public LiveStream {
 public:
  // channel: without the prefix; of image_t of mapmend or of bot_core.  width, height: of the camera, pixels.
  // max_waiting: images that may wait to be taken. Throws std::runtime_error as Bus does.
  LiveImages(const std::string& url, const std::string& channel_prefix, const std::string& channel, int width,
             int height, int max_waiting);
  ~LiveImages() override;

  std::optional<SourceImage> Next() override;
  void Stop() override;
  int64_t NumDropped() const override { return queue_.NumDropped(); }
  int64_t NumBad() const override { return problems_.Count() + num_held_ + bus_.NumRefused(); }
  std::string LastProblem() const override { return problems_.Last(); }
  std::string News() const override { return problems_.News(); }
  int64_t NumNews() const override { return problems_.NumNews(); }
  std::string Name() const override { return name_; }

 private:
  struct Arrival {
    ImageOrder::Good place;
    std::shared_ptr<image_t> message;
  };
  void ReceiveRaw(const uint8_t* data, int size);
  void Receive(std::shared_ptr<image_t> message);
  void Refuse(const std::string& problem);

  const int width_, height_;
  const std::string name_;
  Bus bus_;
  LatestQueue<Arrival> queue_;
  Problems problems_;
  // Of the receiving thread:
  ImageOrder order_;
  EndsOfStream ends_;
  std::map<int64_t, std::shared_ptr<image_t>> held_;  // by their ids in order_
  std::atomic<int64_t> num_held_{0};
  std::atomic<bool> stop_{false};
  Subscription subscription_;
  std::thread thread_;
};

}  // namespace mapmend

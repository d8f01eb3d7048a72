#pragma once

#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>

#include "libs/capture/image_stream.h"
#include "libs/capture/latest_queue.h"

namespace mapmend {

// A file played as a camera would: each image comes when its time has come, whether anybody takes it or not. Whoever is
// too slow gets the newest images, the others are dropped.
class PacedImages : public ImageStream {
 public:
  // source: read in a thread of its own; must outlive this.  speed: times as fast as the images were taken.
  // max_waiting: images that may wait to be taken.
  PacedImages(ImageStream* source, double speed, int max_waiting);
  ~PacedImages() override;

  // Throws what reading threw, once the images before it are taken.
  std::optional<SourceImage> Next() override;
  void Stop() override;
  int64_t NumDropped() const override { return queue_.NumDropped(); }

 private:
  void Play(ImageStream* source, double speed);

  LatestQueue<SourceImage> queue_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_ = false;
  std::exception_ptr error_;  // written before the queue is closed
  std::thread thread_;
};

}  // namespace mapmend

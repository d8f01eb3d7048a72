#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <thread>

#include "procs/frontend/frame.h"
#include "procs/frontend/image_options.h"

namespace mapmend {

// The images of frames that wait for a submap to begin, which may become its keyframes: hundreds of them after a loss.
// They are encoded as they would be kept, in a thread of its own, so that they take a fraction of the memory.
class WaitingImages {
 public:
  // width: see KeptWidth; not kNoImages.  may_wait: Add waits for the encoder rather than give images up
  WaitingImages(const ImageOptions& options, int width, bool may_wait);
  ~WaitingImages();
  WaitingImages(const WaitingImages&) = delete;
  WaitingImages& operator=(const WaitingImages&) = delete;

  // A frame without a pose. If more waits for the encoder than ImageOptions::max_waiting_mb, the oldest images are
  // given up, or it waits.
  void Add(const FramePtr& frame);
  // Waits until all is encoded.
  void Flush();

 private:
  struct Item {
    FramePtr frame;
    int64_t bytes = 0;
  };
  void Run();
  void Encode(const Frame& frame) const;

  const ImageOptions options_;
  const int width_;
  const bool may_wait_;
  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::deque<Item> queue_;
  int64_t queue_bytes_ = 0;
  bool stop_ = false, is_working_ = false;
  std::thread thread_;
};

}  // namespace mapmend

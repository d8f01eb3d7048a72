#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/wide_features.h"
#include "libs/stream/records.h"
#include "procs/frontend/frame.h"

namespace mapmend {

struct WideFeaturesOptions {
  // The first and the last keyframes of a submap of which wide features are published; 0: of none. With eight, a drive
  // has a baseline of some ten metres on either side of a gap, and single wrong frames are outvoted.
  int num_keyframes = 8;
  // Frames after which they are published when nothing depends on timing: long enough for extraction to run beside
  // tracking.
  int delay_frames = 20;
  // Of the newest frames, whose images are held in case they become such keyframes: two megabytes each at 1080p.
  int max_images = 24;
  WideExtractionOptions extraction;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("num_keyframes", num_keyframes, Range(0, 100), "keyframes");
    v("delay_frames", delay_frames, Range(0, 1e6), "frames");
    v("max_images", max_images, Range(0, 100000), "frames");
    v("extraction", extraction);
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Extracts wide features of keyframes in a thread of its own, which starts with the first request, in the order of the
// requests.
class WideExtraction {
 public:
  using Extract = std::function<WideFeatures(const cv::Mat& image)>;
  using Records = std::vector<std::pair<int64_t, RecordBody>>;  // utime of the image, WideFeaturesRecord

  explicit WideExtraction(Extract extract) : extract_(std::move(extract)) {}
  // Finishes the image at hand; those that wait are forgotten.
  ~WideExtraction();

  // frame must hold its image.  due: when the result is to be published at the latest, any count that grows
  void Request(SubmapId submap, KeyframeId keyframe, const Frame& frame, int64_t due);
  // What is finished, in the order of the requests. Both rethrow what extraction threw.
  Records TakeFinished();
  // Waits for what is due at this time; takes that and nothing else, so that it does not depend on timing.
  Records TakeDue(int64_t now);

 private:
  struct Job {
    int64_t utime = 0, due = 0;
    WideFeaturesRecord record;
    std::shared_ptr<const cv::Mat> image;  // null: finished
  };
  void Run();
  Records Take(size_t count);  // with the lock held

  const Extract extract_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  size_t num_finished_ = 0;  // of jobs_, from the front
  std::exception_ptr error_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace mapmend

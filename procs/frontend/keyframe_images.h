#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>

#include "libs/capture/image_stream.h"
#include "libs/images/image_file.h"
#include "libs/images/image_sender.h"
#include "procs/frontend/image_spooler.h"
#include "procs/frontend/run_options.h"
#include "procs/frontend/waiting_images.h"

namespace mapmend {

class HealthReporter;

// The images of a flight's keyframes on their way into the map: spooled beside the outbox, sent when the store asks.
class KeyframeImages {
 public:
  KeyframeImages(const RunOptions& options, const std::string& session);
  ~KeyframeImages();

  bool AreKept() const { return spooler_ != nullptr; }
  // Of a keyframe that is about to be published. Never waits.
  void Take(KeyframeId keyframe, int frame, int64_t utime, const OriginalImage& original);

  // A frame without a pose waits for a submap to begin, and may become a keyframe of it.
  void Wait(const FramePtr& frame) {
    if (waiting_) waiting_->Add(frame);
  }

  // Before a file is read on behalf of a frontend that was killed: which images neither the store has nor the spool.
  // They are taken from the frames that are passed over. Waits for the store's answer a while. Empty names are left
  // out.
  void LookForLost(const std::string& session, const std::string& continued);
  // From the thread that reads.
  void OnPassed(const SourceImage& image);
  void PassedAll();

  // At the end. What the store has not had yet stays in the spool, for whoever looks after it; without an outbox nobody
  // does, so it is waited for.
  void Finish(HealthReporter* health);

 private:
  void WaitUntilStored(HealthReporter* health);

  const std::string url_, channel_prefix_, session_;
  const bool is_spool_kept_;
  std::atomic<bool> has_passed_all_{false};  // until then nobody knows which images there will be
  std::unique_ptr<ImageFile> file_;          // null without images
  std::unique_ptr<ImageSpooler> spooler_;    // the same
  std::unique_ptr<WaitingImages> waiting_;   // the same
  std::unique_ptr<ImageSender> sender_;      // ends before them
  struct Lost {
    std::string session;
    KeyframeId keyframe;
  };
  std::multimap<int, Lost> lost_;  // by frame
};

}  // namespace mapmend

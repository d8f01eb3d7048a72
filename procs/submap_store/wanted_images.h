#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/stream/keyframe_images.h"

namespace mapmend {

// Which images of one session the store lacks, and which it asks for: a few at a time, newest first; again, with longer
// and longer pauses, what nobody sends. Puts the pieces together. Knows no bus and no file.
class WantedImages {
 public:
  using Clock = std::chrono::steady_clock;

  // A keyframe that the store has, with or without its image.
  void Add(KeyframeId keyframe, int frame, bool is_stored);
  // A keyframe that was culled: its image is not wanted any more.
  void Remove(KeyframeId keyframe);
  // All images that were stored are gone.
  void ForgetStored();

  // What is to be said now, if anything.
  std::optional<ImageRequest> NextRequest(const std::string& session, Clock::time_point now);
  // Takes a piece. The image, once it is whole; nothing is believed that was not asked for.
  std::optional<KeyframeImage> Take(const ImagePiece& piece, Clock::time_point now);
  // The image that Take gave is in the file.
  void Stored(KeyframeId keyframe, Clock::time_point now);

  int NumStored() const { return static_cast<int>(stored_.size()); }
  int NumLost() const { return static_cast<int>(lost_.size()); }
  const std::map<KeyframeId, int>& Awaited() const { return awaited_; }  // with frames

 private:
  static constexpr size_t kAtOnce = 4;
  static constexpr size_t kToldAgain = 64;
  static constexpr auto kFirstRetry = std::chrono::milliseconds(1000), kMostRetry = std::chrono::milliseconds(8000);
  static constexpr auto kTellAgain = std::chrono::milliseconds(1000), kTellFor = std::chrono::milliseconds(5000);

  struct Asked {
    std::vector<uint8_t> bytes;  // that have come
    Clock::time_point due;       // when it is asked for again
    std::chrono::milliseconds pause = kFirstRetry;
  };
  void Tell(KeyframeId keyframe, Clock::time_point now);

  std::map<KeyframeId, int> awaited_;
  std::map<KeyframeId, int> stored_, lost_;
  std::map<KeyframeId, Asked> asked_;  // of those awaited
  std::vector<KeyframeId> told_;       // the last ones that need not be kept
  Clock::time_point tell_next_, tell_until_;
  bool has_news_ = false;
};

}  // namespace mapmend

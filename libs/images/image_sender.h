#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "libs/images/image_file.h"

namespace mapmend {

struct ImageSenderOptions {
  std::string lcm_url, channel_prefix;
  int rate_kbit_s = 0;  // at most so much is sent, kbit/s; 0: no limit
  // Of these the sender says so when it has no image of theirs. Of other sessions in its file it sends what it has.
  std::set<std::string> sessions;
  // Whether an image that the file does not hold is still to come. May be empty: none is. Called from a thread of the
  // sender's.
  std::function<bool(const std::string& session, KeyframeId keyframe)> is_pending;
};

// Sends images of a spool as the store asks for them, and lets go of those that the store has. Works in a thread of its
// own with a connection of its own: pieces of images must never stand before the records of the stream.
class ImageSender {
 public:
  // The file must outlive it.
  ImageSender(ImageFile* file, const ImageSenderOptions& options);
  ~ImageSender();
  ImageSender(const ImageSender&) = delete;
  ImageSender& operator=(const ImageSender&) = delete;

  // Thread-safe.
  int64_t NumSent() const;    // images sent to the last byte, also those sent again
  int64_t NumStored() const;  // images that the store has told to be stored
  // Steady clock, milliseconds: when the store last asked for or stored any image; 0: never.
  int64_t LastHeardMs() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// kbit/s that are taken when nobody says: no limit (0) on this host, else what leaves a radio room for the stream.
int DefaultImageRate(const std::string& lcm_url);

}  // namespace mapmend

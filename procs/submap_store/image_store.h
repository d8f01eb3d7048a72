#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libs/stream/ids.h"

namespace mapmend {

struct ImageStoreOptions {
  std::string path;  // of the file of images
  std::string lcm_url, channel_prefix;
};

// The images of the keyframes that a store holds: asks whoever has those that are missing, newest first, a few at a
// time, keeps them in a file of their own, and answers who fetches them. Works in a thread of its own with a connection
// of its own: records never wait for images. Without a file that can be used it says so once, and all images are lost.
class ImageStore {
 public:
  struct Keyframe {
    std::string session;
    KeyframeId keyframe;
    int frame = -1;
  };
  // keyframes: those that the store holds, without those that were culled.
  ImageStore(const ImageStoreOptions& options, std::vector<Keyframe> keyframes);
  ~ImageStore();
  ImageStore(const ImageStore&) = delete;
  ImageStore& operator=(const ImageStore&) = delete;

  // Thread-safe; they never wait. A keyframe was committed; it was culled.
  void Add(Keyframe keyframe);
  void Remove(const std::string& session, KeyframeId keyframe);

  struct Counts {
    int stored = 0, awaited = 0, lost = 0;  // of the keyframes
  };
  Counts GetCounts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend

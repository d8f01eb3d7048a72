#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "libs/images/image_file.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/image_options.h"

namespace mapmend {

// Puts images of keyframes into the spool, encoded if they did not come so, in a thread of its own: whoever tracks
// never waits for an encoder or a disk.
class ImageSpooler {
 public:
  // width: see KeptWidth; not kNoImages. The file must outlive it.
  ImageSpooler(ImageFile* file, const ImageOptions& options, int width);
  // What waits is spooled before it returns.
  ~ImageSpooler();
  ImageSpooler(const ImageSpooler&) = delete;
  ImageSpooler& operator=(const ImageSpooler&) = delete;

  struct Item {
    std::string session;
    KeyframeId keyframe;
    int frame = -1;
    int64_t utime = 0;
    OriginalImage original;
  };
  // Never waits, unless may_wait; gives up the oldest if too much waits. Thread-safe, as are the others.
  void Push(Item item, bool may_wait = false);
  // An image will be pushed, perhaps.
  void Expect(const std::string& session, KeyframeId keyframe);
  // What was expected and has not come will not.
  void ExpectNoMore();
  // Whether an image may come into the file that is not there yet.
  bool IsPending(const std::string& session, KeyframeId keyframe) const;
  // Waits until nothing waits.
  void Flush();
  int64_t NumGivenUp() const;

 private:
  using Key = std::pair<std::string, KeyframeId>;
  void Run();
  void Spool(const Item& item);
  void GiveUp(const std::string& why);
  bool HasRoom() const;

  ImageFile* file_;
  const ImageOptions options_;
  const int width_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::deque<Item> queue_;
  int64_t queue_bytes_ = 0;
  std::set<Key> pending_, expected_;
  int64_t num_given_up_ = 0;
  bool stop_ = false, is_working_ = false;
  std::thread thread_;
};

// Bytes that it takes in memory.
int64_t SizeOf(const OriginalImage& original);

// The image as it is to be kept: a JPEG that is not too wide as it came, all else encoded. Throws std::runtime_error if
// it cannot be.
KeyframeImage EncodeImage(const OriginalImage& original, int width, int quality);

}  // namespace mapmend

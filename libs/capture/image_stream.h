#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

struct SourceImage {
  int index = -1;  // in the input, counting also frames left out
  int64_t utime = 0;
  std::shared_ptr<cv::Mat> pixels;                             // 8-bit BGR or grey
  std::shared_ptr<const std::vector<uint8_t>> jpeg = nullptr;  // as they came, if as a JPEG; else null
};

// Where images come from, one after the other: a file as fast as it can be read, a file at the pace of its times, a
// camera.
class ImageStream {
 public:
  virtual ~ImageStream() = default;
  // Waits for the next image. nullopt at the end, and after Stop.
  virtual std::optional<SourceImage> Next() = 0;
  // From any thread: a Next that waits returns.
  virtual void Stop() {}
  // Images that were not taken in time and are gone.
  virtual int64_t NumDropped() const { return 0; }
};

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/capture/image_stream.h"

namespace cv {
class VideoCapture;
}  // namespace cv

namespace mapmend {

// Frame indices to leave out, from text like "80-120,200-240,300". Throws std::runtime_error naming what is malformed.
std::set<int> ParseFrameRanges(const std::string& text);

// Frames of a video file or of a folder of images (in the order of their names).
class ImageSource : public ImageStream {
 public:
  // times_path may be empty: then times follow from the video's frame rate (or camera_fps for folders). Throws
  // std::runtime_error with one line if there is nothing to read, or times has fewer lines than there are frames.
  ImageSource(const std::string& input, const std::string& times_path, double camera_fps, const std::set<int>& skip);
  ~ImageSource() override;

  std::optional<SourceImage> Next() override;
  int NumFrames() const { return num_frames_; }                // that Next will give, as announced by the input
  const std::string& Truncated() const { return truncated_; }  // one line if the input ended before its announced end

 private:
  int64_t Time(int index) const;

  std::string input_;
  std::vector<std::string> files_;
  std::unique_ptr<cv::VideoCapture> video_;
  std::vector<int64_t> times_;
  double fps_ = 0;
  std::set<int> skip_;
  int next_ = 0, total_ = 0, num_frames_ = 0;
  std::string truncated_;
};

}  // namespace mapmend

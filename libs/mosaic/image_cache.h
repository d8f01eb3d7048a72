#pragma once

#include <functional>
#include <list>
#include <opencv2/core.hpp>
#include <set>
#include <unordered_map>
#include <utility>

#include "libs/geometry/camera.h"

namespace mapmend {

inline cv::Size SizeOf(const Camera& camera) { return {camera.width, camera.height}; }

// 8 bits, 3 channels (BGR), as it was taken; empty if it is not to be had.
//   side  so many pixels along the longer side are enough, if that is faster; there may be more or fewer
using ReadMosaicImage = std::function<cv::Mat(int image, int side)>;

// Decoded images in the size in which they are used, at most so much memory of them: those used last stay.
class ImageCache {
 public:
  ImageCache(ReadMosaicImage read, int max_megabytes)
      : read_(std::move(read)), max_bytes_(size_t{1000000} * static_cast<size_t>(max_megabytes)) {}

  // In that size. Empty if it cannot be had; that is remembered.
  const cv::Mat& Get(int image, const cv::Size& size);
  // An image that somebody has read already, as it was taken.
  void Put(int image, cv::Mat pixels);
  // Those that could not be read.
  const std::set<int>& Missing() const { return missing_; }

 private:
  void Drop(int image);
  void Shrink();

  using Entries = std::list<std::pair<int, cv::Mat>>;

  const ReadMosaicImage read_;
  const size_t max_bytes_;
  size_t bytes_ = 0;
  Entries entries_;  // used last first
  std::unordered_map<int, Entries::iterator> position_;
  std::set<int> missing_;
};

}  // namespace mapmend

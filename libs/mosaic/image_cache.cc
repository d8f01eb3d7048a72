#include "libs/mosaic/image_cache.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace mapmend {
namespace {

size_t BytesOf(const cv::Mat& image) { return image.total() * image.elemSize(); }

}  // namespace

const cv::Mat& ImageCache::Get(int image, const cv::Size& size) {
  const auto found = position_.find(image);
  if (found != position_.end() && (found->second->second.empty() || found->second->second.size() == size)) {
    entries_.splice(entries_.begin(), entries_, found->second);
    return entries_.front().second;
  }
  cv::Mat read = read_(image, std::max(size.width, size.height));
  if (read.empty()) {
    missing_.insert(image);
  } else if (read.size() != size) {
    cv::resize(read, read, size, 0, 0, cv::INTER_AREA);
  }
  Put(image, std::move(read));
  return entries_.front().second;
}

void ImageCache::Put(int image, cv::Mat pixels) {
  Drop(image);
  bytes_ += BytesOf(pixels);
  entries_.emplace_front(image, std::move(pixels));
  position_[image] = entries_.begin();
  Shrink();
}

void ImageCache::Drop(int image) {
  const auto found = position_.find(image);
  if (found == position_.end()) return;
  bytes_ -= BytesOf(found->second->second);
  entries_.erase(found->second);
  position_.erase(found);
}

void ImageCache::Shrink() {
  while (bytes_ > max_bytes_ && entries_.size() > 1) {
    bytes_ -= BytesOf(entries_.back().second);
    position_.erase(entries_.back().first);
    entries_.pop_back();
  }
}

}  // namespace mapmend

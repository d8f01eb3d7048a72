#include "procs/frontend/image_spooler.h"

#include <spdlog/spdlog.h>
#include <sys/statvfs.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "libs/capture/decode_image.h"
#include "procs/frontend/give_way.h"

namespace mapmend {
int64_t SizeOf(const OriginalImage& original) {
  if (original.encoded) return static_cast<int64_t>(original.encoded->bytes.size());
  if (original.jpeg) return static_cast<int64_t>(original.jpeg->size());
  return original.pixels ? static_cast<int64_t>(original.pixels->total() * original.pixels->elemSize()) : 0;
}

KeyframeImage EncodeImage(const OriginalImage& original, int width, int quality) {
  if (original.encoded) return *original.encoded;
  KeyframeImage image;
  const bool fits = width == kFullSize || original.width <= width;
  image.width = fits ? original.width : width;
  image.height =
      fits ? original.height
           : std::max(1, static_cast<int>(std::lround(static_cast<double>(original.height) * width / original.width)));
  if (original.jpeg && fits) {
    image.encoding = "jpeg";
    image.bytes = *original.jpeg;
    return image;
  }
  cv::Mat pixels;
  if (original.pixels) pixels = *original.pixels;
  if (original.jpeg) {
    const DecodedImage decoded = DecodeJpeg(original.jpeg->data(), original.jpeg->size());
    if (!decoded.pixels) throw std::runtime_error("the image " + decoded.problem);
    pixels = *decoded.pixels;
  }
  if (pixels.empty()) throw std::runtime_error("the image is empty");
  if (!fits) {
    cv::Mat smaller;
    cv::resize(pixels, smaller, {image.width, image.height}, 0, 0, cv::INTER_AREA);
    pixels = smaller;
  }
  if (pixels.channels() == 4) {
    cv::Mat opaque;
    cv::cvtColor(pixels, opaque, cv::COLOR_BGRA2BGR);
    pixels = opaque;
  }
  image.encoding = quality == 0 ? "png" : "jpeg";
  const bool is_encoded = quality == 0 ? cv::imencode(".png", pixels, image.bytes, {cv::IMWRITE_PNG_COMPRESSION, 1})
                                       : cv::imencode(".jpg", pixels, image.bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  if (!is_encoded) throw std::runtime_error("the image cannot be encoded");
  return image;
}

ImageSpooler::ImageSpooler(ImageFile* file, const ImageOptions& options, int width)
    : file_(file), options_(options), width_(width) {
  thread_ = std::thread([this] { Run(); });
}

ImageSpooler::~ImageSpooler() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ImageSpooler::Push(Item item, bool may_wait) {
  const int64_t size = SizeOf(item.original), limit = int64_t{options_.max_waiting_mb} << 20;
  std::unique_lock lock(mutex_);
  if (may_wait) changed_.wait(lock, [&] { return queue_.empty() || queue_bytes_ + size <= limit || stop_; });
  while (!queue_.empty() && queue_bytes_ + size > limit) {
    queue_bytes_ -= SizeOf(queue_.front().original);
    pending_.erase({queue_.front().session, queue_.front().keyframe});
    queue_.pop_front();
    if (num_given_up_++ == 0) spdlog::warn("images come faster than they are encoded: some are given up");
  }
  queue_bytes_ += size;
  pending_.insert({item.session, item.keyframe});
  expected_.erase({item.session, item.keyframe});
  queue_.push_back(std::move(item));
  lock.unlock();
  changed_.notify_all();
}

void ImageSpooler::Expect(const std::string& session, KeyframeId keyframe) {
  const std::lock_guard lock(mutex_);
  expected_.insert({session, keyframe});
}

void ImageSpooler::ExpectNoMore() {
  const std::lock_guard lock(mutex_);
  expected_.clear();
}

bool ImageSpooler::IsPending(const std::string& session, KeyframeId keyframe) const {
  const std::lock_guard lock(mutex_);
  return pending_.contains({session, keyframe}) || expected_.contains({session, keyframe});
}

void ImageSpooler::Flush() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return queue_.empty() && !is_working_; });
}

int64_t ImageSpooler::NumGivenUp() const {
  const std::lock_guard lock(mutex_);
  return num_given_up_;
}

void ImageSpooler::GiveUp(const std::string& why) {
  const std::lock_guard lock(mutex_);
  if (num_given_up_++ == 0) spdlog::warn("images of keyframes are not kept: {}", why);
}

bool ImageSpooler::HasRoom() const {
  if (file_->Path().empty()) return true;
  const std::filesystem::path folder = std::filesystem::absolute(file_->Path()).parent_path();
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0) return true;
  return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) >= 1e6 * options_.min_free_mb;
}

void ImageSpooler::Spool(const Item& item) {
  if (!HasRoom()) {
    GiveUp("less than " + std::to_string(options_.min_free_mb) + " MB of the disk are free");
    return;
  }
  try {
    KeyframeImage image = EncodeImage(item.original, width_, options_.quality);
    if (image.bytes.size() > static_cast<size_t>(kMaxImageBytes)) {
      GiveUp("frame " + std::to_string(item.frame) + " takes more than " + std::to_string(kMaxImageBytes >> 20) +
             " MB");
      return;
    }
    image.session = item.session;
    image.keyframe = item.keyframe;
    image.frame = item.frame;
    image.utime = item.utime;
    file_->Put({image});
  } catch (const std::exception& e) {
    GiveUp(e.what());
  }
}

void ImageSpooler::Run() {
  GiveWayToTracking();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return !queue_.empty() || stop_; });
    if (queue_.empty()) return;
    const Item item = std::move(queue_.front());
    queue_.pop_front();
    queue_bytes_ -= SizeOf(item.original);
    is_working_ = true;
    lock.unlock();
    Spool(item);
    lock.lock();
    is_working_ = false;
    pending_.erase({item.session, item.keyframe});
    changed_.notify_all();
  }
}

}  // namespace mapmend

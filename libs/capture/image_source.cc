#include "libs/capture/image_source.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>
#include <stdexcept>

#include "libs/geometry/times_file.h"

namespace mapmend {
namespace {

bool IsImageName(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  static const std::set<std::string> kKnown = {".jpg", ".jpeg", ".png", ".tif", ".tiff",
                                               ".bmp", ".pgm",  ".ppm", ".webp"};
  return kKnown.contains(extension);
}

[[noreturn]] void FailRanges(const std::string& text) {
  throw std::runtime_error("--skip-frames " + text + ": expected ranges of frames, e.g. 80-120,200-240");
}

int ParseIndex(const std::string& text, const std::string& whole) {
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) FailRanges(whole);
  return value;
}

// 16-bit images are stretched to their own range, so that thermal and other narrow-range cameras keep their texture.
cv::Mat To8Bit(const cv::Mat& image) {
  if (image.depth() == CV_8U) return image;
  cv::Mat result;
  double low = 0, high = 0;
  cv::minMaxLoc(image.reshape(1), &low, &high);
  const double scale = high > low ? 255.0 / (high - low) : 1.0;
  image.convertTo(result, CV_8U, scale, -low * scale);
  return result;
}

}  // namespace

std::set<int> ParseFrameRanges(const std::string& text) {
  if (text.ends_with(',')) FailRanges(text);
  std::set<int> frames;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const size_t dash = part.find('-');
    const int first = ParseIndex(part.substr(0, dash), text);
    const int last = dash == std::string::npos ? first : ParseIndex(part.substr(dash + 1), text);
    if (last < first || last - first > 10000000) FailRanges(text);
    for (int i = first; i <= last; ++i) frames.insert(i);
  }
  return frames;
}

ImageSource::ImageSource(const std::string& input, const std::string& times_path, double camera_fps,
                         const std::set<int>& skip)
    : input_(input), skip_(skip) {
  namespace fs = std::filesystem;
  if (!fs::exists(input)) throw std::runtime_error("input " + input + ": no such file or folder");
  if (fs::is_directory(input)) {
    for (const auto& entry : fs::directory_iterator(input)) {
      if (entry.is_regular_file() && IsImageName(entry.path())) files_.push_back(entry.path().string());
    }
    std::sort(files_.begin(), files_.end());
    if (files_.empty()) throw std::runtime_error("input " + input + ": the folder holds no images");
    total_ = static_cast<int>(files_.size());
    fps_ = camera_fps > 0 ? camera_fps : 30;
  } else {
    video_ = std::make_unique<cv::VideoCapture>(input);
    if (!video_->isOpened()) throw std::runtime_error("input " + input + ": cannot be read as a video");
    total_ = static_cast<int>(video_->get(cv::CAP_PROP_FRAME_COUNT));
    fps_ = video_->get(cv::CAP_PROP_FPS);
    if (!(fps_ > 0)) fps_ = camera_fps > 0 ? camera_fps : 30;
  }
  if (!times_path.empty()) {
    times_ = ReadFrameTimes(times_path).utimes;
    if (static_cast<int>(times_.size()) < total_) {
      throw std::runtime_error("times file " + times_path + ": " + std::to_string(times_.size()) + " times for " +
                               std::to_string(total_) + " frames");
    }
  }
  num_frames_ = total_;
  for (const int i : skip_) num_frames_ -= i < total_;
}

ImageSource::~ImageSource() = default;

int64_t ImageSource::Time(int index) const {
  if (!times_.empty()) return times_[std::min<size_t>(index, times_.size() - 1)];
  return std::llround(index * 1e6 / fps_);
}

std::optional<SourceImage> ImageSource::Next() {
  while (true) {
    const int index = next_++;
    const bool skipped = skip_.contains(index);
    cv::Mat image;
    if (video_) {
      if (skipped ? !video_->grab() : !video_->read(image)) {
        if (index < total_) {
          truncated_ = "input " + input_ + ": ends after " + std::to_string(index) + " of " + std::to_string(total_) +
                       " frames; the file is truncated or damaged";
        }
        return std::nullopt;
      }
      if (!times_.empty() && index >= static_cast<int>(times_.size())) return std::nullopt;
    } else {
      if (index >= total_) return std::nullopt;
      if (!skipped) image = cv::imread(files_[index], cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
      if (!skipped && image.empty()) {
        truncated_ = "input " + files_[index] + ": cannot be read as an image; it was left out";
        continue;
      }
    }
    if (skipped) continue;
    return SourceImage{index, Time(index), std::make_shared<cv::Mat>(To8Bit(image))};
  }
}

}  // namespace mapmend

#include "procs/frontend/frame_maker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "libs/features/wide_signature.h"

namespace mapmend {
namespace {

// Mean absolute Laplacian on a small image: falls when the image is blurred by motion.
double Sharpness(const cv::Mat& grey) {
  cv::Mat small, laplacian;
  cv::resize(grey, small, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::Laplacian(small, laplacian, CV_16S);
  return cv::norm(laplacian, cv::NORM_L1) / static_cast<double>(laplacian.total());
}

template <typename T>
void Keep(const std::vector<bool>& wanted, std::vector<T>* values) {
  size_t kept = 0;
  for (size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i]) (*values)[kept++] = (*values)[i];
  }
  values->resize(kept);
}

// Leaves out the features that have no place in the ideal camera. Returns how many.
int KeepSeen(const std::vector<bool>& seen, RawFeatures* raw, std::vector<std::array<uint8_t, 3>>* colors) {
  const auto num_unseen = std::count(seen.begin(), seen.end(), false);
  if (num_unseen == 0) return 0;
  Keep(seen, &raw->keypoints);
  Keep(seen, &raw->descriptors);
  Keep(seen, colors);
  return static_cast<int>(num_unseen);
}

// Larger images are halved: some of them are held, and wide features do not need them.
std::shared_ptr<const cv::Mat> KeptImage(const cv::Mat& grey) {
  constexpr size_t kMaxPixels = 4000000;
  auto kept = std::make_shared<cv::Mat>(grey);
  while (kept->total() > kMaxPixels) {
    cv::Mat half;
    cv::resize(*kept, half, {}, 0.5, 0.5, cv::INTER_AREA);
    *kept = half;
  }
  return kept;
}

std::shared_ptr<const cv::Mat> SomePixels(const cv::Mat& pixels) {
  constexpr double kShare = 0.25;  // of width and height
  const auto some = std::make_shared<cv::Mat>();
  cv::resize(pixels, *some, {}, kShare, kShare, cv::INTER_NEAREST);
  return some;
}

std::array<uint8_t, 3> ColorAt(const cv::Mat& pixels, double x, double y) {
  const int column = std::clamp(static_cast<int>(std::lround(x)), 0, pixels.cols - 1);
  const int row = std::clamp(static_cast<int>(std::lround(y)), 0, pixels.rows - 1);
  const uint8_t* p = pixels.ptr<uint8_t>(row) + ptrdiff_t{column} * pixels.channels();
  if (pixels.channels() == 1) return {*p, *p, *p};
  return {p[2], p[1], p[0]};
}

}  // namespace

FramePtr FrameMaker::Make(const SourceImage& image) const {
  cv::Mat pixels = *image.pixels;
  if (pixels.cols != input_width_ || pixels.rows != input_height_) {
    throw std::runtime_error("frame " + std::to_string(image.index) + " has " + std::to_string(pixels.cols) + " x " +
                             std::to_string(pixels.rows) + " pixels, the camera file says " +
                             std::to_string(input_width_) + " x " + std::to_string(input_height_));
  }
  if (pixels.cols != camera_.width || pixels.rows != camera_.height) {
    cv::resize(*image.pixels, pixels, {camera_.width, camera_.height}, 0, 0, cv::INTER_AREA);
  }
  cv::Mat grey = pixels;
  if (pixels.channels() == 3) cv::cvtColor(pixels, grey, cv::COLOR_BGR2GRAY);
  if (pixels.channels() == 4) cv::cvtColor(pixels, grey, cv::COLOR_BGRA2GRAY);
  auto frame = std::make_shared<Frame>();
  if (keep_images_) {
    frame->image = KeptImage(grey);
    frame->colors = SomePixels(pixels);
  }
  if (keep_originals_) {
    frame->original.Set({image.jpeg, image.jpeg ? nullptr : image.pixels, image.pixels->cols, image.pixels->rows});
  }
  frame->index = image.index;
  frame->utime = image.utime;
  frame->mean_brightness = cv::mean(grey)[0];
  frame->sharpness = Sharpness(grey);
  RawFeatures raw = extractor_.Extract(grey, mask_.get());
  std::vector<Eigen::Vector2f> distorted;
  for (const Keypoint& k : raw.keypoints) {
    distorted.push_back(k.pixel);
    frame->features.colors.push_back(ColorAt(pixels, k.pixel.x(), k.pixel.y()));
  }
  std::vector<bool> seen;
  const std::vector<Eigen::Vector2f> undistorted = camera_.Undistort(distorted, &seen);
  for (size_t i = 0; i < undistorted.size(); ++i) raw.keypoints[i].pixel = undistorted[i];
  frame->num_unseen = KeepSeen(seen, &raw, &frame->features.colors);
  frame->features.keypoints = std::move(raw.keypoints);
  frame->features.descriptors = std::move(raw.descriptors);
  frame->grid = FeatureGrid(frame->features.keypoints, camera_.width, camera_.height);
  return frame;
}

WideFeatures FrameMaker::ExtractWide(const cv::Mat& image, const WideExtractionOptions& options,
                                     std::vector<Eigen::Vector2f>* distorted) const {
  cv::Mat mask;
  if (mask_) cv::resize(*mask_, mask, image.size(), 0, 0, cv::INTER_NEAREST);
  WideFeatures features = ExtractWideFeatures(image, mask_ ? &mask : nullptr, options);
  const float scale = static_cast<float>(camera_.width) / static_cast<float>(image.cols);
  const auto larger = static_cast<int>(std::lround(WideKeypoint::kSizesPerOctave * std::log2(scale)));
  distorted->clear();
  for (WideKeypoint& k : features.keypoints) {
    distorted->emplace_back(scale * (k.pixel.x() + 0.5F) - 0.5F, scale * (k.pixel.y() + 0.5F) - 0.5F);
    k.size = static_cast<uint8_t>(std::min(255, k.size + larger));
  }
  std::vector<bool> seen;
  const std::vector<Eigen::Vector2f> undistorted = camera_.Undistort(*distorted, &seen);
  for (size_t i = 0; i < undistorted.size(); ++i) features.keypoints[i].pixel = undistorted[i];
  Keep(seen, distorted);
  Keep(seen, &features.keypoints);
  Keep(seen, &features.descriptors);
  return features;
}

WideFeatures FrameMaker::ExtractWide(const cv::Mat& image, const WideExtractionOptions& options) const {
  std::vector<Eigen::Vector2f> distorted;
  return ExtractWide(image, options, &distorted);
}

FramePtr FrameMaker::WithWideFeatures(const FramePtr& photo, const WideExtractionOptions& options) const {
  auto frame = std::make_shared<Frame>();
  frame->index = photo->index;
  frame->utime = photo->utime;
  frame->mean_brightness = photo->mean_brightness;
  frame->sharpness = photo->sharpness;
  frame->photo = photo;
  std::vector<Eigen::Vector2f> distorted;
  frame->features = SignaturesOf(ExtractWide(*photo->image, options, &distorted), extractor_.ImagePyramid());
  const double share = static_cast<double>(photo->colors->cols) / camera_.width;
  for (const Eigen::Vector2f& pixel : distorted)
    frame->features.colors.push_back(ColorAt(*photo->colors, share * pixel.x(), share * pixel.y()));
  frame->grid = FeatureGrid(frame->features.keypoints, camera_.width, camera_.height);
  return frame;
}

}  // namespace mapmend

#include "libs/capture/image_mask.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "libs/base/write_file.h"

namespace mapmend {
namespace {

constexpr double kSameShape = 0.01;  // relative difference of the aspect ratios

[[noreturn]] void Fail(const std::string& path, const std::string& what) {
  throw std::runtime_error("mask " + path + ": " + what);
}

// The value of mask_rectangles, at the root ("Feature.mask_rectangles" too) or one level below.
YAML::Node FindRectangles(const YAML::Node& root) {
  if (!root.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  for (const auto& entry : root) {
    if (!entry.first.IsScalar()) continue;
    if (entry.first.Scalar().ends_with("mask_rectangles")) return entry.second;
    const YAML::Node& below = entry.second;
    if (below.IsMap() && below["mask_rectangles"]) return below["mask_rectangles"];
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

cv::Mat FromRectangles(const std::string& path, std::string text, int width, int height) {
  if (text.starts_with("%YAML")) text.erase(0, std::min(text.find('\n'), text.size()));
  cv::Mat mask(height, width, CV_8UC1, cv::Scalar(255));
  try {
    const YAML::Node rectangles = FindRectangles(YAML::Load(text));
    if (!rectangles) Fail(path, "is neither an image nor YAML with the key mask_rectangles");
    if (!rectangles.IsSequence()) Fail(path, "key mask_rectangles is not a list");
    for (const auto& entry : rectangles) {
      const auto r = entry.as<std::vector<double>>();
      const bool good = r.size() == 4 && r[0] >= 0 && r[0] < r[1] && r[1] <= 1 && r[2] >= 0 && r[2] < r[3] && r[3] <= 1;
      if (!good) Fail(path, "key mask_rectangles needs lists of x_min, x_max, y_min, y_max, fractions from 0 to 1");
      const int left = static_cast<int>(std::floor(r[0] * width)), right = static_cast<int>(std::ceil(r[1] * width));
      const int top = static_cast<int>(std::floor(r[2] * height)), bottom = static_cast<int>(std::ceil(r[3] * height));
      mask(cv::Rect(left, top, right - left, bottom - top)).setTo(0);
    }
  } catch (const YAML::Exception&) {
    Fail(path, "is neither an image nor YAML with the key mask_rectangles");
  }
  return mask;
}

cv::Mat FromImage(const std::string& path, const cv::Mat& image, int width, int height) {
  const double aspect = image.cols / static_cast<double>(image.rows) * height / width;
  if (std::abs(aspect - 1) > kSameShape) {
    Fail(path, "has " + std::to_string(image.cols) + " x " + std::to_string(image.rows) + " pixels, the images have " +
                   std::to_string(width) + " x " + std::to_string(height) + ": it needs the same shape");
  }
  std::vector<cv::Mat> channels;
  cv::split(image, channels);
  cv::Mat mask, brightest = channels[0];
  const size_t num_colors = channels.size() == 4 || channels.size() == 2 ? channels.size() - 1 : channels.size();
  for (size_t i = 1; i < num_colors; ++i) brightest = cv::max(brightest, channels[i]);
  cv::threshold(brightest, mask, 127, 255, cv::THRESH_BINARY);
  if (num_colors < channels.size()) mask.setTo(0, channels.back() < 128);
  if (mask.cols != width || mask.rows != height) cv::resize(mask, mask, {width, height}, 0, 0, cv::INTER_NEAREST);
  return mask;
}

}  // namespace

cv::Mat ReadMask(const std::string& path, int width, int height) {
  std::string bytes;
  try {
    bytes = ReadFile(path);
  } catch (const std::runtime_error&) {
    Fail(path, "cannot be read");
  }
  if (bytes.empty()) Fail(path, "is empty");
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::Mat image;
  try {
    // Like the images of the flight: as stored, whatever a tag says about rotation.
    image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()), cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
  }
  if (!image.empty() && image.depth() != CV_8U) {
    if (image.depth() != CV_16U) Fail(path, "needs 8 or 16 bits for each pixel");
    image.convertTo(image, CV_8U, 1 / 256.0);
  }
  const cv::Mat mask =
      image.empty() ? FromRectangles(path, bytes, width, height) : FromImage(path, image, width, height);
  if (cv::countNonZero(mask) == 0) Fail(path, "covers the whole image: black is where no features may be");
  return mask;
}

}  // namespace mapmend

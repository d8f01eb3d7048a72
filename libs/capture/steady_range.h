#pragma once

#include <optional>

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// Brings images of 16 bits (thermal cameras above all) to 8. The range that becomes 0 to 255 leaves out the lowest and
// highest half percent of the pixels, so that hot and dead ones do not matter, and follows the scene slowly: a range
// chosen anew for each image would make everything brighter or darker whenever something hot comes into view.
// The result depends on the images alone.
class SteadyRange {
 public:
  // 8-bit images are returned as they are. Any depth, any number of channels.
  cv::Mat To8Bit(const cv::Mat& image);

 private:
  struct Range {
    double low = 0, high = 0;
  };
  static std::optional<Range> Measure(const cv::Mat& image);
  static bool Overlap(const Range& a, const Range& b);

  std::optional<Range> range_;
};

}  // namespace mapmend

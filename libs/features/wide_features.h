#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// Root-SIFT (Arandjelovic and Zisserman, CVPR 2012): square roots of SIFT's L1-normalised histogram, times 256, at most
// 127, so that a dot product of two fits pairs of bytes of SSSE3. About unit length when divided by 256.
using WideDescriptor = std::array<uint8_t, 128>;

struct WideKeypoint {
  static constexpr double kSizesPerOctave = 16;

  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();
  uint8_t size = 0;   // diameter of the patch, pixels: 2 ^ (size / 16)
  uint8_t angle = 0;  // orientation: 2 pi angle / 256 radians

  double SizePx() const;
};

// Features that are recognised over larger changes of scale and view than ORB's, and cost a hundred times as much. Both
// vectors have the same length.
struct WideFeatures {
  std::vector<WideKeypoint> keypoints;
  std::vector<WideDescriptor> descriptors;

  int Size() const { return static_cast<int>(keypoints.size()); }
};

struct WideExtractionOptions {
  int max_features = 3000;            // the strongest; about 140 bytes each in the stream
  double contrast_threshold = 0.025;  // of OpenCV's SIFT, whose 0.04 leaves too few on fields and asphalt
  double max_megapixels = 1.0;  // larger images are halved: SIFT doubles them again, and its cost is that of pixels

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_features", max_features, Range(1, 100000), "per image");
    v("contrast_threshold", contrast_threshold, MoreThan(0));
    v("max_megapixels", max_megapixels, MoreThan(0), "megapixels");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// OpenCV's SIFT of a grey 8-bit image, strongest first, pixels of the image given. The same image gives the same
// features, whatever the number of threads. mask: of the image's size, 0 where no feature may be; null: none.
WideFeatures ExtractWideFeatures(const cv::Mat& grey, const cv::Mat* mask, const WideExtractionOptions& options);

// Dot product of two descriptors; 65536 stands for 1.
int WideDot(const WideDescriptor& a, const WideDescriptor& b);
// Squared distance of two descriptors, in the same units: 0 for equal ones, about 131072 for those with nothing in
// common.
inline int WideSquaredDistance(const WideDescriptor& a, const WideDescriptor& b) {
  return WideDot(a, a) + WideDot(b, b) - 2 * WideDot(a, b);
}

struct WideMatch {
  int a = -1, b = -1;        // features
  int squared_distance = 0;  // WideSquaredDistance
};

struct WideMatchingOptions {
  double ratio = 0.8;     // of the distances to the nearest and to the second nearest (Lowe, IJCV 2004)
  double same_place = 5;  // pixels: the second nearest is another feature than one that near to the nearest

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("ratio", ratio, Range(0, 1));
    v("same_place", same_place, AtLeast(0), "pixels");
  }
};

// Matches of two images by descriptors alone, each the nearest of the other, ascending by a.
std::vector<WideMatch> MatchWide(const WideFeatures& a, const WideFeatures& b, const WideMatchingOptions& options);

}  // namespace mapmend

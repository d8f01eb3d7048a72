#pragma once

#include <memory>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/features/features.h"

namespace cv {
class Mat;
}

namespace mapmend {

struct OrbOptions {
  int num_features = 1000;     // at most; fewer where the image has no texture
  double scale_factor = 1.2;   // between pyramid levels
  int num_levels = 8;          // levels too small for one patch stay empty
  int fast_threshold = 20;     // grey levels
  int min_fast_threshold = 7;  // in cells without a corner at fast_threshold
  int cell_size = 32;          // pixels of the level; the cells of the adaptive threshold
  int corners_per_node = 4;    // 1: spread as evenly as can be; more: stronger corners, found again more often

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("num_features", num_features, Range(1, 100000));
    VisitCorners(v);
  }

  // All but the number of features.
  template <typename Visitor>
  void VisitCorners(Visitor& v) {
    v("scale_factor", scale_factor, Range(1.01, 4));
    v("num_levels", num_levels, Range(1, 32));
    v("fast_threshold", fast_threshold, Range(1, 254), "grey levels");
    v("min_fast_threshold", min_fast_threshold, Range(1, 254), "grey levels");
    v("cell_size", cell_size, Range(8, 1024), "pixels");
    v("corners_per_node", corners_per_node, Range(1, 100000));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
  // Empty, or which options contradict each other.
  std::string Conflict() const;
};

// Features of one image as extracted; both vectors have the same length. Ordered by octave, then along a space-filling
// curve.
struct RawFeatures {
  std::vector<Keypoint>
      keypoints;  // pixel: of the image given, that is with lens distortion; level 0, centres at integers
  std::vector<Descriptor> descriptors;

  int Size() const { return static_cast<int>(keypoints.size()); }
};

// ORB features: FAST corners on an image pyramid with a threshold that adapts per cell, spread evenly over image and
// levels, each at a pixel of its level, oriented by intensity centroid, described by oriented BRIEF (Rublee et al.,
// ICCV 2011). Descriptors fit the vocabularies of ORB-SLAM. Same image and options, same bits. Thread-safe.
class OrbExtractor {
 public:
  explicit OrbExtractor(const OrbOptions& options);
  ~OrbExtractor();

  // grey8: one channel, 8 bit; throws std::invalid_argument otherwise. Any size, also empty.
  //   mask8  of the image's size, 0 where no feature may be; null: none
  RawFeatures Extract(const cv::Mat& grey8, const cv::Mat* mask8 = nullptr) const;

  const OrbOptions& Options() const { return options_; }
  Pyramid ImagePyramid() const { return {options_.scale_factor, options_.num_levels}; }

 private:
  struct Impl;
  OrbOptions options_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend

#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/local_window.h"

namespace mapmend {

// A keyframe with wide features, where the submap has come to lie. It may have been culled: then `keyframe` is what
// stands for it, and the pose is its own.
struct WideFrame {
  KeyframeId keyframe;
  bool is_keyframe = false;  // itself, not culled
  int64_t utime = 0;
  Rigid3 cam_from_submap;
  std::shared_ptr<const WideFeatures> features;
};

struct WideObservation {
  int frame = -1, feature = -1;
};

// Something that the wide features of one submap show, in one frame or in several.
struct WideTrack {
  std::vector<WideObservation> observations;  // ascending by frame, at most one of each
  // Triangulated, if it is seen under angles that leave its depth open by less than a share; submap frame. Else
  // has_point is false: only its direction is known.
  bool has_point = false;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

// One end of a submap as wide features show it.
struct WideSide {
  SubmapView view;
  std::vector<WideFrame> frames;           // the nearest to the gap last
  std::vector<WideTrack> tracks;           // of every feature one
  std::vector<std::vector<int>> track_of;  // per frame and feature

  const WideKeypoint& Keypoint(const WideObservation& o) const {
    return frames[o.frame].features->keypoints[o.feature];
  }
  const WideDescriptor& Descriptor(const WideObservation& o) const {
    return frames[o.frame].features->descriptors[o.feature];
  }
};

struct WideTrackOptions {
  double ratio = 0.8;               // of descriptor distances, among those near the epipolar line
  double max_distance = 3;          // from the epipolar line, in standard deviations
  int max_size_change = 16;         // sixteenths of an octave, between frames of one submap
  double max_squared_error = 9.21;  // of an observation, in sigma^2: 99 % of a chi-square with 2 degrees of freedom
  double max_depth_sigma = 0.3;     // of the depth, as a share of it: beyond it a track has no point
  // Of a frame that is added behind the others: those before it that it is matched with, and how much sizes may differ.
  int num_before = 4;
  int max_size_change_between = 32;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("ratio", ratio, Range(0, 1));
    v("max_distance", max_distance, MoreThan(0), "sigma");
    v("max_size_change", max_size_change, Range(0, 255), "1/16 octave");
    v("max_squared_error", max_squared_error, MoreThan(0), "sigma^2");
    v("max_depth_sigma", max_depth_sigma, MoreThan(0), "of the depth");
    v("num_before", num_before, Range(1, 1000), "frames");
    v("max_size_change_between", max_size_change_between, Range(0, 255), "1/16 octave");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Standard deviation of a feature's place, pixels: blobs are found to a share of their size, and the poses of keyframes
// have some noise of their own.
double WideSigma(const WideKeypoint& keypoint);

// Matches the frames of a side with each other where their known poses allow, follows features through them, and
// triangulates.
WideSide MakeWideSide(const SubmapView& view, std::vector<WideFrame> frames, const WideTrackOptions& options);
// One more, behind the others.
void AddWideFrame(WideFrame frame, const WideTrackOptions& options, WideSide* side);

}  // namespace mapmend

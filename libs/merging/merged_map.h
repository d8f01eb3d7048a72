#pragma once

#include <compare>
#include <string>
#include <utility>
#include <vector>

#include "libs/connecting/connected_frames.h"
#include "libs/connecting/local_window.h"
#include "libs/geometry/similarity3.h"
#include "libs/merging/rolling_shutter.h"
#include "libs/stream/feature_source.h"

// The merged map of one component: keyframes and points of all its submaps in the frame of the root. It refers to the
// raw submaps, which never change.
namespace mapmend {

struct MergedKeyframe {
  int submap = -1;  // index into MergedMap::submaps
  const SubmapKeyframe* keyframe = nullptr;
  Rigid3 cam_from_root;
  double scale = 1;          // length of one submap unit near this keyframe, root units
  CameraMotion motion = {};  // see MeasureMotions

  // x_root = root_from_cam * x_cam with x_cam in submap units.
  Similarity3 RootFromCam() const {
    const Rigid3 inverse = cam_from_root.Inverse();
    return {scale, inverse.rotation, inverse.translation};
  }
};

// A feature that observes a map point; a negative one is a wide feature. What geometry asks of it is kept beside it:
// the features themselves are not held.
struct TrackElement {
  int keyframe = -1;  // index into MergedMap::keyframes
  int feature : 24 = -1;
  int octave : 8 = 0;
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();

  void SetPlace(const Keypoint& keypoint) {
    octave = keypoint.octave;
    pixel = keypoint.pixel;
  }
  // By keyframe and feature, which determine the rest.
  friend bool operator==(const TrackElement& l, const TrackElement& r) {
    return l.keyframe == r.keyframe && l.feature == r.feature;
  }
  friend std::strong_ordering operator<=>(const TrackElement& l, const TrackElement& r) {
    return l.keyframe != r.keyframe ? l.keyframe <=> r.keyframe : int{l.feature} <=> int{r.feature};
  }
};

using Track = CompactVector<TrackElement>;

// A map point of the merged map: one or, after fusion, several map points of the submaps.
struct MergedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // root frame
  Track track;  // ascending, at most one per keyframe; empty: fused away or culled
  // The map points of submaps that it is: (submap index, id), the oldest first, then those fused into it, ascending.
  // A wide point has none: an invalid id.
  std::pair<int, MapPointId> first;
  CompactVector<std::pair<int, MapPointId>> fused;
};

struct MergedMap {
  std::vector<SubmapView> submaps;                 // oldest first; 0 is the root
  std::vector<MergedKeyframe> keyframes;           // by submap, then id
  std::vector<MergedPoint> points;                 // by submap, then id, before fusion
  std::vector<std::vector<int>> point_of_feature;  // per keyframe and feature: index into points, -1 without

  std::vector<Shutter> shutters;  // per submap
  std::vector<int> num_wide;      // features so far, per keyframe

  const Pinhole& CameraOf(int keyframe) const { return submaps[keyframes[keyframe].submap].camera; }
  const Pyramid& PyramidOf(int keyframe) const { return submaps[keyframes[keyframe].submap].pyramid; }
  // Standard deviation of where a feature lies, pixels.
  double Sigma(const TrackElement& element) const { return PyramidOf(element.keyframe).Sigma(element.octave); }
  // Pixels to add to where a feature is, per second of readout time, to get where it would be if all lines had been
  // read at once. x_cam: where its point is, root units.
  Eigen::Vector2d ShutterCorrection(const TrackElement& element, const Eigen::Vector3d& x_cam) const;
  // Where a feature would be if all lines had been read at once.
  Eigen::Vector2d Pixel(const TrackElement& element, const Eigen::Vector3d& x_cam) const;
  // Squared reprojection error in sigma^2; infinite behind the camera.
  double SquaredError(const MergedPoint& point, const TrackElement& element) const;
  // Index of a keyframe, -1 if it is not in the map.
  int FindKeyframe(int submap, KeyframeId id) const;
};

// Puts every submap in place as it is.
MergedMap MakeMergedMap(const std::vector<SubmapView>& submaps, const std::vector<Similarity3>& root_from_submap,
                        const OpenFeatureSource& open_features = {});

// Adds what wide features of two submaps see in common, where its place in the first puts it. Points that fewer than
// two keyframes see, or that only one of the submaps sees, are left out.
void AddWidePoints(const WideCommonPoints& points, int submap_a, int submap_b, MergedMap* map);

// Sets the motion of each keyframe, which corrections of a rolling shutter need, from the frames of its submap.
void MeasureMotions(MergedMap* map);

// Makes the points follow their keyframes after the poses have changed: each point keeps its place in the camera frame
// of the keyframe that saw it first.
void MovePointsWithKeyframes(const std::vector<MergedKeyframe>& before, MergedMap* map);

// Fuses point `from` into point `into` if no keyframe sees both at different features; else nothing changes and false
// is returned. The position becomes the mean, weighted by track length.
bool FusePoints(int into, int from, MergedMap* map);

// Adds an observation to a point unless its keyframe sees the point already, or the feature sees another point.
bool AddToTrack(int point, const TrackElement& element, MergedMap* map);

void RemoveFromTrack(int point, TrackElement element, MergedMap* map);

// Errors of all observations.
struct ReprojectionStatistics {
  int num_observations = 0;
  double median_px = 0;
  double mean_robust = 0;  // mean over observations of min(squared error in sigma^2, 25)
};
ReprojectionStatistics MeasureReprojection(const MergedMap& map);

}  // namespace mapmend

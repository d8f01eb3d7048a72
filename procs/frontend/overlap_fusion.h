#pragma once

#include <vector>

#include "libs/geometry/camera.h"
#include "libs/optim/pose_optimization.h"
#include "procs/frontend/local_mapper_options.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// Survey flights come back beside their own strips: keyframes far away in time see the same ground, with a little
// drift. Their points are projected with a wider window; if enough of them agree on a small correction, they are the
// same points.
class OverlapFusion {
 public:
  OverlapFusion(const LocalMapperOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // Fuses points of the keyframe with those of earlier ones that overlap it and are not among its neighbours.
  void Fuse(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours, WorkingMap* map) const;

 private:
  struct PointMatch {
    PointIndex point;
    FeatureIndex feature;
  };
  // One of each for every match.
  struct Matches {
    std::vector<PointMatch> matches;
    std::vector<PoseObservation> observations;
  };
  // The best of them, best first.
  //   depth  median of the points that the keyframe sees
  std::vector<KeyframeIndex> Overlapping(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours,
                                         double depth, const WorkingMap& map) const;
  Matches Search(const WorkingKeyframe& keyframe, const std::vector<PointIndex>& points, const WorkingMap& map) const;

  LocalMapperOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
};

}  // namespace mapmend

#pragma once

#include <vector>

#include "libs/geometry/camera.h"
#include "libs/optim/bundle_adjuster.h"
#include "procs/frontend/local_mapper_options.h"
#include "procs/frontend/map_lock.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// Bundle adjustment in the working map. What turns out to be an outlier is no observation any more.
class LocalBundle {
 public:
  LocalBundle(const LocalMapperOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // A keyframe and those that share most points with it; others that see those points hold them in place.
  //   lock  given back while the adjustment computes; null: nobody else uses the map
  void AdjustAround(KeyframeIndex keyframe, WorkingMap* map, MapLock* lock);
  // All keyframes; the first is fixed.
  void AdjustAll(WorkingMap* map);

 private:
  struct Source {
    PointIndex point;
    KeyframeIndex keyframe;
  };
  // The problem, and what its parts are in the map.
  struct Window {
    BundleProblem problem;
    std::vector<KeyframeIndex> keyframes;  // by pose
    std::vector<PointIndex> points;        // by point
    std::vector<Source> sources;           // by observation
  };
  std::vector<KeyframeIndex> MostCovisible(KeyframeIndex keyframe, const WorkingMap& map) const;
  // Of those that are not free, the ones that share most points with them.
  std::vector<KeyframeIndex> FixedFor(const std::vector<KeyframeIndex>& free, const WorkingMap& map) const;
  Window Collect(const std::vector<KeyframeIndex>& free, const std::vector<KeyframeIndex>& fixed,
                 const WorkingMap& map) const;
  void Adjust(const std::vector<KeyframeIndex>& free, const std::vector<KeyframeIndex>& fixed, int iterations,
              WorkingMap* map, MapLock* lock);
  void Apply(const Window& window, WorkingMap* map) const;

  LocalMapperOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  BundleAdjuster bundle_;
};

}  // namespace mapmend

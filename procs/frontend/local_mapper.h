#pragma once

#include <vector>

#include "libs/geometry/camera.h"
#include "procs/frontend/epipolar_triangulation.h"
#include "procs/frontend/local_bundle.h"
#include "procs/frontend/local_mapper_options.h"
#include "procs/frontend/map_lock.h"
#include "procs/frontend/overlap_fusion.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

// What happens to the map when a keyframe joins: new points are triangulated with its neighbours, duplicates fused, the
// neighbourhood bundle adjusted, bad points culled. Equal maps and calls give equal maps.
class LocalMapper {
 public:
  LocalMapper(const LocalMapperOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options),
        camera_(camera),
        pyramid_(pyramid),
        triangulation_(options, camera, pyramid),
        overlap_fusion_(options, camera, pyramid),
        bundle_(options, camera, pyramid) {}

  // lock: given back between steps and while bundle adjustment computes; meanwhile keyframes may join the map, nothing
  // may leave it. Null: nobody else uses the map.
  void Process(KeyframeIndex keyframe, WorkingMap* map, MapLock* lock = nullptr);
  // Bundle adjustment of all keyframes, of those that were not culled.
  void AdjustAll(WorkingMap* map) { bundle_.AdjustAll(map); }

 private:
  void CullRecentPoints(KeyframeIndex keyframe, WorkingMap* map) const;
  // Neighbours of a keyframe that say nothing which others do not say.
  void CullKeyframes(KeyframeIndex keyframe, WorkingMap* map) const;
  bool IsRedundant(KeyframeIndex keyframe, const WorkingMap& map) const;
  void Triangulate(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours, WorkingMap* map,
                   MapLock* lock) const;
  // Projects points into a keyframe; adds observations or fuses with what is there.
  void FuseInto(KeyframeIndex keyframe, const std::vector<PointIndex>& points, WorkingMap* map) const;
  // Both ways, with the neighbours and with theirs.
  void FuseNeighbourhood(KeyframeIndex keyframe, const std::vector<KeyframeIndex>& neighbours, WorkingMap* map,
                         MapLock* lock) const;

  LocalMapperOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  EpipolarTriangulation triangulation_;
  OverlapFusion overlap_fusion_;
  LocalBundle bundle_;
};

}  // namespace mapmend

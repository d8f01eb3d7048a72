#pragma once

#include <vector>

#include "libs/geometry/camera.h"
#include "libs/optim/bundle_adjuster.h"
#include "procs/frontend/map_lock.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

struct LocalMapperOptions {
  int num_neighbours = 10;     // keyframes to triangulate and fuse with
  int min_covisible = 15;      // shared points of a neighbour
  double min_angle_deg = 1.0;  // between the rays of a new point
  int max_distance = 60;       // bits
  double ratio = 0.85;
  double fuse_radius_px = 3;
  int max_overlapping_keyframes = 6;  // searched by place, though they share no points yet (strips side by side)
  double overlap_radius = 0.02;       // search radius there, of the image width
  int bundle_keyframes = 12;          // optimised by local bundle adjustment
  int bundle_fixed_keyframes = 20;    // that hold it in place
  int bundle_iterations = 5;
  int bundle_points = 150;  // that determine a keyframe's pose there; the other points follow
  double outlier_chi2 = 5.991;
  double redundant_share = 0.9;  // of a keyframe's points that enough others see as well as it does: it is culled
  int redundant_observers = 3;   // keyframes that see a point at the same octave, give or take one, or a finer one
};

// What happens to the map when a keyframe joins: new points are triangulated with its neighbours, duplicates fused, the
// neighbourhood bundle adjusted, bad points culled. Equal maps and calls give equal maps.
class LocalMapper {
 public:
  LocalMapper(const LocalMapperOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  // lock: given back between steps and while bundle adjustment computes; meanwhile keyframes may join the map, nothing
  // may leave it. Null: nobody else uses the map.
  void Process(int keyframe, WorkingMap* map, MapLock* lock = nullptr);
  // Bundle adjustment of all keyframes, for a submap that has just begun.
  void AdjustAll(WorkingMap* map);

 private:
  void CullRecentPoints(int keyframe, WorkingMap* map) const;
  // Neighbours of a keyframe that say nothing which others do not say.
  void CullKeyframes(int keyframe, WorkingMap* map) const;
  bool IsRedundant(int keyframe, const WorkingMap& map) const;
  void Triangulate(int keyframe, const std::vector<int>& neighbours, WorkingMap* map, MapLock* lock) const;
  int TriangulateWith(int keyframe, int neighbour, double near, double far, WorkingMap* map) const;
  // Projects points into a keyframe; adds observations or fuses with what is there. Returns how many.
  int FuseInto(int keyframe, const std::vector<int>& points, double radius_px, WorkingMap* map) const;
  // Both ways, with the neighbours and with theirs.
  void FuseNeighbourhood(int keyframe, const std::vector<int>& neighbours, WorkingMap* map, MapLock* lock) const;
  void FuseWithOverlapping(int keyframe, const std::vector<int>& neighbours, WorkingMap* map) const;
  void Adjust(const std::vector<int>& free_keyframes, const std::vector<int>& fixed_keyframes, int iterations,
              WorkingMap* map, MapLock* lock);
  void AdjustLocal(int keyframe, WorkingMap* map, MapLock* lock);

  LocalMapperOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  BundleAdjuster bundle_;
};

}  // namespace mapmend

#pragma once

#include <set>
#include <vector>

#include "libs/geometry/rigid3.h"
#include "libs/stream/records.h"
#include "procs/frontend/frame.h"
#include "procs/frontend/index.h"

// The submap under construction, as the frontend works on it. Keyframes and points are addressed by their index; ids of
// the stream are given out once, in order. Every change is noted, so that TakeUpdate can publish exactly what changed.
namespace mapmend {

struct WorkingObservation {
  KeyframeIndex keyframe;
  FeatureIndex feature;
};

struct WorkingPoint {
  MapPointId id;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // submap frame
  Descriptor descriptor{};                             // the one nearest to all others
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    // mean viewing direction, from point to cameras
  double max_distance = 0;                             // from which it would be seen at octave 0
  std::vector<WorkingObservation> observations;        // ascending by keyframe
  KeyframeIndex first_keyframe;
  int visible = 1, found = 1;  // frames that should have seen it, that did
  bool removed = false;
  bool descriptor_current = false;  // no observation has come or gone since it was chosen
  bool published = false;
  bool dirty = false;  // its position is to be published
};

struct WorkingKeyframe {
  KeyframeId id;
  FramePtr frame;
  Rigid3 cam_from_submap;
  std::vector<PointIndex> points;  // that it observes, one for each feature; none without
  bool published = false;
  bool removed = false;                      // culled: the pose stays, the frame has no features any more
  std::vector<FeatureIndex> dirty_features;  // whose points are to be published; a feature may occur twice
};

struct Covisible {
  KeyframeIndex keyframe;
  int shared_points = 0;
};

// Hands out ids that are unique within a session.
struct IdSource {
  int32_t next_keyframe = 0, next_point = 0, next_submap = 0;
};

class WorkingMap {
 public:
  WorkingMap(SubmapId id, const Pyramid& pyramid, IdSource* ids) : id_(id), pyramid_(pyramid), ids_(ids) {}

  SubmapId Id() const { return id_; }
  const std::vector<WorkingKeyframe>& Keyframes() const { return keyframes_; }
  const std::vector<WorkingPoint>& Points() const { return points_; }
  // References hold until a keyframe, or a point, is added.
  const WorkingKeyframe& Keyframe(KeyframeIndex index) const { return keyframes_[index]; }
  const WorkingPoint& Point(PointIndex index) const { return points_[index]; }
  WorkingPoint* MutablePoint(PointIndex index) { return &points_[index]; }  // counters only
  KeyframeIndex LastKeyframe() const { return KeyframeIndex(static_cast<int>(keyframes_.size()) - 1); }
  int NumPoints() const;

  //   points  one for each feature, none where it shows no known point; empty: it shows none at all
  KeyframeIndex AddKeyframe(const FramePtr& frame, const Rigid3& cam_from_submap,
                            const std::vector<PointIndex>& points = {});
  PointIndex AddPoint(const Eigen::Vector3d& position, KeyframeIndex first_keyframe);
  // Does nothing if the keyframe observes the point already, or another one with that feature.
  void AddObservation(PointIndex point, KeyframeIndex keyframe, FeatureIndex feature);
  void RemoveObservation(PointIndex point, KeyframeIndex keyframe);  // the point too when fewer than two remain
  void RemovePoint(PointIndex point);
  void RemoveKeyframe(KeyframeIndex keyframe);  // which is published
  // All observations of from go to into, where into has none in that keyframe; from is removed.
  void FusePoints(PointIndex from, PointIndex into);
  void SetPose(KeyframeIndex keyframe, const Rigid3& cam_from_submap);
  void SetPosition(PointIndex point, const Eigen::Vector3d& position);
  // Renews descriptor, normal and distance from the observations.
  void RefreshPoint(PointIndex point);
  // Points that the keyframe observes, ascending.
  std::vector<PointIndex> PointsOf(KeyframeIndex keyframe) const;
  // The same of several keyframes together.
  std::vector<PointIndex> PointsOf(const std::vector<KeyframeIndex>& keyframes) const;

  // Keyframes that share at least min_shared points, most first (ties: newer first).
  std::vector<Covisible> CovisibleKeyframes(KeyframeIndex keyframe, int min_shared) const;
  // Octave at which a point at this distance would be seen.
  int PredictOctave(const WorkingPoint& point, double distance) const;

  // Points of the keyframe that are published already; the rest follows in the next update.
  std::vector<MapPointId> PublishedPoints(KeyframeIndex keyframe) const;
  void MarkPublished(KeyframeIndex keyframe);
  // Everything that changed since the last call, for keyframes that are published. frames is left empty.
  MapUpdate TakeUpdate();

 private:
  SubmapId id_;
  Pyramid pyramid_;
  IdSource* ids_;
  std::vector<WorkingKeyframe> keyframes_;
  std::vector<WorkingPoint> points_;
  void ChooseDescriptor(WorkingPoint* point) const;
  void MarkDirty(PointIndex point);

  std::set<KeyframeIndex> dirty_keyframes_;  // their poses are to be published
  std::vector<PointIndex> dirty_points_;     // in any order; a point once
  std::vector<KeyframeId> removed_keyframes_;
  std::vector<MapPointId> removed_points_;
};

}  // namespace mapmend

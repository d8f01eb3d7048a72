#pragma once

#include <set>
#include <vector>

#include "libs/stream/records.h"
#include "procs/frontend/frame.h"

// The submap under construction, as the frontend works on it. Keyframes and points are addressed by their index; ids of
// the stream are given out once, in order. Every change is noted, so that TakeUpdate can publish exactly what changed.
namespace mapmend {

struct WorkingObservation {
  int keyframe = -1;
  int feature = -1;
};

struct WorkingPoint {
  MapPointId id;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // submap frame
  Descriptor descriptor{};                             // the one nearest to all others
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    // mean viewing direction, from point to cameras
  double max_distance = 0;                             // from which it would be seen at octave 0
  std::vector<WorkingObservation> observations;        // ascending by keyframe
  int first_keyframe = -1;
  int visible = 1, found = 1;  // frames that should have seen it, that did
  bool removed = false;
  bool descriptor_current = false;  // no observation has come or gone since it was chosen
  bool published = false;
  bool dirty = false;  // its position is to be published
};

struct WorkingKeyframe {
  KeyframeId id;
  FramePtr frame;
  bool published = false;
  bool removed = false;             // culled: the frame keeps its pose, but no features
  std::vector<int> dirty_features;  // whose points are to be published; a feature may occur twice
};

struct Covisible {
  int keyframe = -1;
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
  const WorkingKeyframe& Keyframe(int index) const { return keyframes_[index]; }
  const WorkingPoint& Point(int index) const { return points_[index]; }
  WorkingPoint* MutablePoint(int index) { return &points_[index]; }  // counters only
  int LastKeyframe() const { return static_cast<int>(keyframes_.size()) - 1; }
  int NumPoints() const;

  // The frame's points become observations.
  int AddKeyframe(const FramePtr& frame);
  int AddPoint(const Eigen::Vector3d& position, int first_keyframe);
  void AddObservation(int point, int keyframe, int feature);
  void RemoveObservation(int point, int keyframe);  // removes the point too when fewer than two remain
  void RemovePoint(int point);
  void RemoveKeyframe(int keyframe);  // which is published
  // All observations of from go to into, where into has none in that keyframe; from is removed.
  void FusePoints(int from, int into);
  void SetPose(int keyframe, const Rigid3& cam_from_submap);
  void SetPosition(int point, const Eigen::Vector3d& position);
  // Renews descriptor, normal and distance from the observations.
  void RefreshPoint(int point);
  // Points that the keyframe observes, ascending.
  std::vector<int> PointsOf(int keyframe) const;
  // The same of several keyframes together.
  std::vector<int> PointsOf(const std::vector<int>& keyframes) const;

  // Keyframes that share at least min_shared points, most first (ties: newer first).
  std::vector<Covisible> CovisibleKeyframes(int keyframe, int min_shared) const;
  // Octave at which a point at this distance would be seen.
  int PredictOctave(const WorkingPoint& point, double distance) const;

  // Points of the keyframe that are published already; the rest follows in the next update.
  std::vector<MapPointId> PublishedPoints(int keyframe) const;
  void MarkPublished(int keyframe);
  // Everything that changed since the last call, for keyframes that are published. frames is left empty.
  MapUpdate TakeUpdate();

 private:
  SubmapId id_;
  Pyramid pyramid_;
  IdSource* ids_;
  std::vector<WorkingKeyframe> keyframes_;
  std::vector<WorkingPoint> points_;
  void ChooseDescriptor(WorkingPoint* point) const;
  void MarkDirty(int point);

  std::set<int> dirty_keyframes_;  // their poses are to be published
  std::vector<int> dirty_points_;  // in any order; a point once
  std::vector<KeyframeId> removed_keyframes_;
  std::vector<MapPointId> removed_points_;
};

}  // namespace mapmend

#include "libs/map_view/snapshot.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "libs/geometry/interpolation.h"

namespace mapmend {
namespace {

// What the refinement says of one submap's keyframes; empty: it was not refined.
using RefinedKeyframes = std::map<KeyframeId, RefinedSubmap::Keyframe>;

const RefinedSubmap* FindRefined(const MapModel& model, const SubmapKey& key) {
  const std::vector<RefinedSubmap>& all = model.Revision().refined;
  const auto it =
      std::find_if(all.begin(), all.end(), [&](const RefinedSubmap& refined) { return refined.key == key; });
  return it == all.end() ? nullptr : &*it;
}

RefinedKeyframes FindRefinedKeyframes(const MapModel& model, const SubmapKey& key) {
  RefinedKeyframes keyframes;
  if (const RefinedSubmap* refined = FindRefined(model, key)) {
    for (const RefinedSubmap::Keyframe& keyframe : refined->keyframes) keyframes[keyframe.id] = keyframe;
  }
  return keyframes;
}

// Pose relative to a keyframe, carried over to the keyframe's refined pose.
Rigid3 Follow(const Rigid3& cam_from_keyframe, const RefinedSubmap::Keyframe& keyframe) {
  return Rigid3(cam_from_keyframe.rotation, keyframe.scale * cam_from_keyframe.translation) * keyframe.cam_from_root;
}

// Places the frames of one submap. A frame follows the refined keyframes on both sides of it, in time, the more the
// nearer they are.
class FramePlacer {
 public:
  FramePlacer(const MapModel& model, const SnapshotSubmap& submap)
      : model_(model), submap_(submap), refined_(FindRefinedKeyframes(model, submap.key)) {
    for (const auto& [id, keyframe] : submap.submap->keyframes) {
      if (refined_.contains(id)) refined_times_.emplace_back(keyframe.utime, id);
    }
    std::sort(refined_times_.begin(), refined_times_.end());
  }

  Rigid3 Place(const TrackedFrame& frame) const {
    if (refined_times_.empty()) return TransformWorld(submap_.submap->CamFromSubmap(frame), submap_.root_from_submap);
    const auto after =
        std::lower_bound(refined_times_.begin(), refined_times_.end(), std::pair(frame.utime, KeyframeId()));
    if (after == refined_times_.end()) return PlaceBy(frame, refined_times_.back().second);
    if (after == refined_times_.begin() || after->first == frame.utime) return PlaceBy(frame, after->second);
    const auto before = std::prev(after);
    const double share =
        static_cast<double>(frame.utime - before->first) / static_cast<double>(after->first - before->first);
    return Between(PlaceBy(frame, before->second), PlaceBy(frame, after->second), share);
  }

  int64_t KeyframeDistance(const TrackedFrame& frame) const {
    return std::abs(frame.utime - model_.KeyframeUtime(submap_.key.session, frame.keyframe));
  }

 private:
  Rigid3 PlaceBy(const TrackedFrame& frame, KeyframeId keyframe) const {
    const Rigid3 cam_from_keyframe =
        submap_.submap->CamFromSubmap(frame) * submap_.submap->keyframes.at(keyframe).cam_from_submap.Inverse();
    return Follow(cam_from_keyframe, refined_.at(keyframe));
  }

  const MapModel& model_;
  const SnapshotSubmap& submap_;
  const RefinedKeyframes refined_;
  std::vector<std::pair<int64_t, KeyframeId>> refined_times_;
};

std::vector<MergedFrame> PlaceFrames(const MapModel& model, const SnapshotSubmap& submap) {
  const FramePlacer placer(model, submap);
  std::map<int, MergedFrame> by_frame;
  for (const TrackedFrame& frame : submap.submap->frames) {
    // What was told last counts.
    by_frame[frame.frame] = {submap.session, frame.frame, frame.utime, placer.Place(frame),
                             placer.KeyframeDistance(frame)};
  }
  std::vector<MergedFrame> frames;
  for (const auto& [index, frame] : by_frame) frames.push_back(frame);
  return frames;
}

// Merges the frames of a component's submaps: one pose for each (session, frame).
std::vector<MergedFrame> JoinFrames(const Snapshot& snapshot, const std::vector<int>& submaps) {
  std::map<std::pair<int, int>, MergedFrame> best;
  for (const int index : submaps) {
    for (const MergedFrame& frame : snapshot.submaps[index].frames) {
      const auto [it, inserted] = best.try_emplace({frame.session, frame.frame}, frame);
      if (!inserted && frame.keyframe_distance_us < it->second.keyframe_distance_us) it->second = frame;
    }
  }
  std::vector<MergedFrame> frames;
  for (const auto& [key, frame] : best) frames.push_back(frame);
  std::stable_sort(frames.begin(), frames.end(),
                   [](const MergedFrame& a, const MergedFrame& b) { return a.utime < b.utime; });
  return frames;
}

std::vector<SnapshotKeyframe> PlaceKeyframes(const Snapshot& snapshot, const std::vector<int>& submaps) {
  std::vector<SnapshotKeyframe> keyframes;
  for (const int index : submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[index];
    const RefinedKeyframes refined = FindRefinedKeyframes(*snapshot.model, submap.key);
    for (const auto& [id, keyframe] : submap.submap->keyframes) {
      SnapshotKeyframe placed{index, id, keyframe.utime, Rigid3()};
      const auto it = refined.find(id);
      const bool is_refined = it != refined.end();
      placed.cam_from_root =
          is_refined ? it->second.cam_from_root : TransformWorld(keyframe.cam_from_submap, submap.root_from_submap);
      placed.scale = is_refined ? it->second.scale : submap.root_from_submap.scale;
      keyframes.push_back(placed);
    }
  }
  std::stable_sort(keyframes.begin(), keyframes.end(),
                   [](const SnapshotKeyframe& a, const SnapshotKeyframe& b) { return a.utime < b.utime; });
  return keyframes;
}

void ListSubmaps(Snapshot* snapshot) {
  int offset = 0;
  const std::vector<std::string>& order = snapshot->model->SessionOrder();
  for (size_t s = 0; s < order.size(); ++s) {
    const Session& session = snapshot->model->GetSession(order[s]);
    int highest = -1;
    for (const auto& [id, submap] : session.submaps) {
      SnapshotSubmap entry;
      entry.number = offset + id.value;
      entry.session = static_cast<int>(s);
      entry.key = {order[s], id};
      entry.submap = &submap;
      snapshot->submaps.push_back(entry);
      highest = std::max(highest, id.value);
    }
    offset += highest + 1;
  }
}

// Components as the merger sees them; a submap it does not know yet stands alone.
std::vector<SnapshotComponent> GroupSubmaps(Snapshot* snapshot) {
  std::map<int, SnapshotComponent> groups;
  int next_single = std::numeric_limits<int>::max() / 2;
  for (size_t i = 0; i < snapshot->submaps.size(); ++i) {
    SnapshotSubmap& submap = snapshot->submaps[i];
    const std::vector<MergedTransforms::Place>& merged = snapshot->model->Revision().transforms.submaps;
    const auto it = std::find_if(merged.begin(), merged.end(),
                                 [&](const MergedTransforms::Place& place) { return place.key == submap.key; });
    const bool known = it != merged.end();
    SnapshotComponent& group = groups[known ? it->component : next_single++];
    submap.is_root = known ? it->is_root : true;
    if (known) submap.root_from_submap = it->root_from_submap;
    if (group.submaps.empty() || submap.is_root) group.root = static_cast<int>(i);
    group.submaps.push_back(static_cast<int>(i));
  }
  std::vector<SnapshotComponent> components;
  for (auto& [id, group] : groups) components.push_back(std::move(group));
  return components;
}

}  // namespace

int Snapshot::FindSubmap(const SubmapKey& key) const {
  for (size_t i = 0; i < submaps.size(); ++i) {
    if (submaps[i].key == key) return static_cast<int>(i);
  }
  return -1;
}

Snapshot MakeSnapshot(const MapModel& model) {
  Snapshot snapshot;
  snapshot.model = &model;
  ListSubmaps(&snapshot);
  snapshot.components = GroupSubmaps(&snapshot);
  std::set<std::pair<int, int>> tracked;
  for (SnapshotSubmap& submap : snapshot.submaps) {
    submap.frames = PlaceFrames(model, submap);
    for (const MergedFrame& frame : submap.frames) tracked.emplace(frame.session, frame.frame);
  }
  snapshot.num_frames_tracked = static_cast<int>(tracked.size());
  for (SnapshotComponent& component : snapshot.components) {
    component.frames = JoinFrames(snapshot, component.submaps);
    component.keyframes = PlaceKeyframes(snapshot, component.submaps);
  }
  std::stable_sort(
      snapshot.components.begin(), snapshot.components.end(),
      [](const SnapshotComponent& a, const SnapshotComponent& b) { return a.frames.size() > b.frames.size(); });
  for (size_t c = 0; c < snapshot.components.size(); ++c) {
    for (const int index : snapshot.components[c].submaps) snapshot.submaps[index].component = static_cast<int>(c);
  }
  for (size_t s = 0; s < model.SessionOrder().size(); ++s) {
    const Session& session = model.GetSession(model.SessionOrder()[s]);
    const auto num_tracked = std::count_if(tracked.begin(), tracked.end(),
                                           [&](const auto& frame) { return frame.first == static_cast<int>(s); });
    // A session whose frontend died may not say how many frames it read.
    snapshot.num_frames_in +=
        std::max(session.ended ? session.num_frames : session.info.num_frames, static_cast<int>(num_tracked));
  }
  return snapshot;
}

void PlaceInFrame(const FrameOfReference& frame, const Similarity3& frame_from_root, int index, Snapshot* snapshot) {
  SnapshotComponent& component = snapshot->components[index];
  component.frame = frame;
  component.frame_from_root = frame_from_root;
  const auto place = [&](Rigid3* cam_from_root) { *cam_from_root = TransformWorld(*cam_from_root, frame_from_root); };
  for (MergedFrame& f : component.frames) place(&f.cam_from_root);
  for (SnapshotKeyframe& k : component.keyframes) {
    place(&k.cam_from_root);
    k.scale *= frame_from_root.scale;
  }
  for (const int s : component.submaps) {
    for (MergedFrame& f : snapshot->submaps[s].frames) place(&f.cam_from_root);
  }
}

std::vector<ColoredPoint> ComponentPoints(const Snapshot& snapshot, int component) {
  std::vector<ColoredPoint> points;
  const SnapshotComponent& placed = snapshot.components[component];
  const bool is_moved = placed.frame.name != FrameOfReference().name;
  for (const int index : snapshot.components[component].submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[index];
    // Of a submap that was refined: the points that it kept, and that are not fused into another's.
    std::map<MapPointId, Eigen::Vector3f> kept;
    const RefinedSubmap* refined = FindRefined(*snapshot.model, submap.key);
    const bool is_refined = refined != nullptr && !refined->points.empty();
    if (is_refined) {
      for (const RefinedSubmap::Point& point : refined->points) kept[point.id] = point.position;
      for (const RefinedSubmap::Fused& fused : refined->fused) kept.erase(fused.id);
    }
    for (const auto& [id, point] : submap.submap->points) {
      ColoredPoint colored;
      colored.submap = index;
      colored.id = id;
      if (is_refined) {
        const auto it = kept.find(id);
        if (it == kept.end()) continue;
        colored.position = it->second.cast<double>();
      } else {
        colored.position = submap.root_from_submap * point.position.cast<double>();
      }
      if (is_moved) colored.position = placed.frame_from_root * colored.position;
      std::array<int, 3> sum = {0, 0, 0};
      int n = 0;
      for (const SubmapObservation& observation : point.observations) {
        const Features& features = submap.submap->keyframes.at(observation.keyframe).features;
        if (features.colors.empty()) continue;
        for (int c = 0; c < 3; ++c) sum[c] += features.colors[observation.feature][c];
        ++n;
      }
      for (int c = 0; c < 3 && n > 0; ++c) colored.color[c] = static_cast<uint8_t>((sum[c] + n / 2) / n);
      points.push_back(colored);
    }
  }
  return points;
}

Trajectory ToTrajectory(const std::vector<MergedFrame>& frames) {
  Trajectory trajectory;
  for (const MergedFrame& frame : frames) trajectory.push_back({frame.utime, frame.cam_from_root.Inverse()});
  return trajectory;
}

Trajectory ToTrajectory(const std::vector<SnapshotKeyframe>& keyframes) {
  Trajectory trajectory;
  for (const SnapshotKeyframe& keyframe : keyframes) {
    trajectory.push_back({keyframe.utime, keyframe.cam_from_root.Inverse()});
  }
  return trajectory;
}

Trajectory TrackedTrajectory(const Submap& submap) {
  std::map<int, StampedPose> by_frame;  // a frame tracked again replaces its earlier pose
  for (const TrackedFrame& frame : submap.frames) {
    by_frame[frame.frame] = {frame.utime, submap.CamFromSubmap(frame).Inverse()};
  }
  Trajectory trajectory;
  for (const auto& [index, pose] : by_frame) trajectory.push_back(pose);
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.utime < b.utime; });
  return trajectory;
}

}  // namespace mapmend

#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "libs/formats/placed_map.h"
#include "libs/geometry/trajectory_file.h"
#include "libs/map_view/map_model.h"

// The map as it stands, worked out once for all exporters: submaps with numbers, components, every frame's merged pose.
namespace mapmend {

// A tracked frame placed in the merged map.
struct MergedFrame {
  int session = 0;  // index into MapModel::SessionOrder
  int frame = -1;
  int64_t utime = 0;
  Rigid3 cam_from_root;
  int64_t keyframe_distance_us = 0;  // between the frame and the keyframe that its pose refers to
};

struct SnapshotSubmap {
  // Unique in the snapshot and used in file names: the submap's id in its session, counted on from session to session.
  int number = 0;
  int session = 0;
  SubmapKey key;
  const Submap* submap = nullptr;  // of the model, which must outlive the snapshot
  int component = 0;               // index into Snapshot::components
  bool is_root = false;
  Similarity3 root_from_submap;
  std::vector<MergedFrame> frames;  // ascending by frame, each once

  // Ended by a loss of tracking (not by the end of the input, and not still growing).
  bool Lost() const { return submap->ended && submap->end_reason != "end_of_input"; }
};

struct SnapshotKeyframe {
  int submap = 0;  // index into Snapshot::submaps
  KeyframeId id;
  int64_t utime = 0;
  Rigid3 cam_from_root;
  double scale = 1;  // length of one submap unit near it, in root units
};

// "Root" in all names means the frame of the component's root submap, until PlaceInFrame puts another one in its place.
struct SnapshotComponent {
  int root = 0;                             // index into Snapshot::submaps
  std::vector<int> submaps;                 // indices, ascending
  std::vector<MergedFrame> frames;          // ascending by time; a frame tracked in several submaps has one pose here
  std::vector<SnapshotKeyframe> keyframes;  // ascending by time
  FrameOfReference frame;                   // of all the poses, and of ComponentPoints
  Similarity3 frame_from_root;              // from that of the root submap
};

struct Snapshot {
  const MapModel* model = nullptr;
  std::vector<SnapshotSubmap> submaps;        // ascending by number
  std::vector<SnapshotComponent> components;  // most frames first: components[0] is the main one
  int num_frames_in = 0;                      // fed to all frontends; while a session lasts, what it expects
  int num_frames_tracked = 0;                 // distinct frames with a pose in any submap

  // Index into submaps, -1 without.
  int FindSubmap(const SubmapKey& key) const;
};

// A submap that the merged map does not name is a component of its own. How a frame is placed:
//   - by the refined pose of its keyframe, with its own pose relative to the keyframe scaled by the keyframe's scale;
//   - if its keyframe was culled or not refined, by the refined keyframe of its submap nearest in time;
//   - without refinement by root_from_submap.
// Where several submaps of a component hold a frame, the pose whose keyframe is nearest in time counts; ties: lower
// number.
Snapshot MakeSnapshot(const MapModel& model);

// Moves a component into another frame: poses, those of its submaps' frames included, scales, and what ComponentPoints
// will list. root_from_submap of its submaps stays. To be called at most once for each component.
void PlaceInFrame(const FrameOfReference& frame, const Similarity3& frame_from_root, int component, Snapshot* snapshot);

struct ColoredPoint {
  Eigen::Vector3d position;                        // frame of the component
  std::array<uint8_t, 3> color = {160, 160, 160};  // mean of its observations; grey without
  int submap = 0;                                  // index into Snapshot::submaps
  MapPointId id;
};

// The points of one component, each once: those fused into an older point, and those that refinement left out, are not
// listed.
std::vector<ColoredPoint> ComponentPoints(const Snapshot& snapshot, int component);

// world_from_camera, in the frame of the component.
Trajectory ToTrajectory(const std::vector<MergedFrame>& frames);
Trajectory ToTrajectory(const std::vector<SnapshotKeyframe>& keyframes);
// As tracked: world_from_camera in the submap's own frame, ascending by time.
Trajectory TrackedTrajectory(const Submap& submap);

}  // namespace mapmend

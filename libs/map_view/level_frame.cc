#include "libs/map_view/level_frame.h"

#include <vector>

#include "libs/base/text_format.h"
#include "libs/drawing/top_view.h"

namespace mapmend {

LevelFrame FindLevelFrame(int index, const Snapshot& snapshot) {
  const SnapshotComponent& component = snapshot.components[index];
  std::vector<Eigen::Vector3d> points;
  for (const ColoredPoint& point : ComponentPoints(snapshot, index)) points.push_back(point.position);
  return FindLevelFrame(points, ToTrajectory(component.keyframes),
                        DominantPlane(ToTrajectory(component.frames)).x_axis);
}

void PlaceLevel(int index, Snapshot* snapshot) {
  if (snapshot->components[index].keyframes.empty()) return;
  const LevelFrame level = FindLevelFrame(index, *snapshot);
  FrameOfReference frame;
  frame.name = "level";
  frame.is_z_up = true;
  frame.note = level.ground
                   ? Format("z is up, across the plane that %.0f %% of the points lie on", 100 * level.ground->share)
                   : "z is up if the camera was held without rolling: no ground plane was found";
  const Rigid3& transform = level.level_from_map;
  PlaceInFrame(frame, Similarity3(1, transform.rotation, transform.translation), index, snapshot);
}

}  // namespace mapmend

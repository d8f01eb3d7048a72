#include "libs/map_view/world.h"

#include <algorithm>
#include <cmath>

#include "libs/base/degree.h"
#include "libs/base/text_format.h"

namespace mapmend {

std::vector<SessionFixes> PositionsOf(const Snapshot& snapshot) {
  std::vector<SessionFixes> sessions;
  for (const std::string& id : snapshot.model->SessionOrder()) {
    sessions.emplace_back();
    std::vector<PositionFix>& fixes = sessions.back().fixes;
    fixes = snapshot.model->GetSession(id).positions;
    std::stable_sort(fixes.begin(), fixes.end(), [](const auto& a, const auto& b) { return a.utime < b.utime; });
    // A frontend that was started again may tell some twice.
    const auto is_same = [](const PositionFix& a, const PositionFix& b) { return a.utime == b.utime; };
    fixes.erase(std::unique(fixes.begin(), fixes.end(), is_same), fixes.end());
  }
  return sessions;
}

std::optional<WorldPlacement> PlaceOnEarth(const Snapshot& snapshot, const PlacementOptions& options) {
  const std::vector<SessionFixes> sessions = PositionsOf(snapshot);
  if (std::all_of(sessions.begin(), sessions.end(), [](const auto& s) { return s.fixes.empty(); })) return std::nullopt;
  std::vector<std::vector<TrackPoint>> tracks;
  for (const SnapshotComponent& component : snapshot.components) {
    tracks.emplace_back();
    for (const MergedFrame& frame : component.frames)
      tracks.back().push_back({frame.session, frame.utime, frame.cam_from_root});
  }
  return PlaceComponents(tracks, sessions, options);
}

void PlaceOnEarth(const WorldPlacement& world, const std::string& name, Snapshot* snapshot) {
  const bool on_grid = name == "utm";
  const Geodetic& origin = world.frame.origin();
  const UtmFrame utm(origin);
  FrameOfReference frame;
  frame.name = name;
  frame.unit.assign(1, 'm');  // GCC 12 warns falsely of what assigns the literal
  frame.is_z_up = true;
  frame.epsg = on_grid ? utm.Epsg() : 0;
  if (on_grid) {
    const std::string zone = utm.Name();
    frame.note = Format("easting, northing, height as told, in %s", zone.c_str());
  } else {
    frame.note =
        Format("east, north, up; origin: %.9f %.9f %.3f", origin.latitude_deg, origin.longitude_deg, origin.altitude_m);
  }
  Similarity3 frame_from_enu;
  if (on_grid) {
    frame.origin = utm.FromGeodetic(origin);
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(utm.ConvergenceDeg(origin) * kDegree, Eigen::Vector3d::UnitZ()));
    frame_from_enu = Similarity3(utm.Scale(origin), turn, Eigen::Vector3d::Zero());
  }
  for (size_t c = 0; c < world.components.size(); ++c) {
    if (world.components[c].success)
      PlaceInFrame(frame, frame_from_enu * world.components[c].enu_from_map, static_cast<int>(c), snapshot);
  }
}

}  // namespace mapmend

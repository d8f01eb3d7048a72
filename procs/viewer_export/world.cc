#include "procs/viewer_export/world.h"

#include <algorithm>
#include <cmath>

#include "libs/base/median.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

constexpr double kDegree = M_PI / 180;

}  // namespace

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

WorldError MeasureWorldError(const Trajectory& trajectory, const LocalFrame& world, const GroundTruth& ground_truth,
                             const std::optional<Geodetic>& origin) {
  WorldError error;
  std::optional<LocalFrame> truth_frame;
  if (origin) truth_frame.emplace(*origin);
  std::vector<Eigen::Vector3d> differences;
  for (const TimePair& pair : AssociateByTime(trajectory, ground_truth.trajectory, ground_truth.options.tolerance_us)) {
    Eigen::Vector3d truth = ground_truth.trajectory[pair.reference].world_from_camera.translation;
    if (truth_frame) truth = world.ToEnu(truth_frame->ToGeodetic(truth));
    differences.push_back(trajectory[pair.estimate].world_from_camera.translation - truth);
  }
  error.num_pairs = differences.size();
  if (differences.empty()) return error;
  std::vector<double> horizontal, up;
  const double n = static_cast<double>(differences.size());
  for (const Eigen::Vector3d& d : differences) {
    horizontal.push_back(d.head<2>().norm());
    up.push_back(d.z());
    error.rmse_horizontal_m += d.head<2>().squaredNorm() / n;
    error.mean_east_m += d.x() / n;
    error.mean_north_m += d.y() / n;
  }
  error.rmse_horizontal_m = std::sqrt(error.rmse_horizontal_m);
  error.max_horizontal_m = *std::max_element(horizontal.begin(), horizontal.end());
  error.median_horizontal_m = Median(std::move(horizontal));
  error.mean_up_m = Median(up);
  for (const double v : up) error.rmse_vertical_m += (v - error.mean_up_m) * (v - error.mean_up_m) / n;
  error.rmse_vertical_m = std::sqrt(error.rmse_vertical_m);
  return error;
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

std::string MakePositionsCsv(const Snapshot& snapshot, const WorldPlacement& world) {
  const std::vector<SessionFixes> sessions = PositionsOf(snapshot);
  std::string text =
      "session,component,time_s,latitude_deg,longitude_deg,altitude_m,east_m,north_m,up_m,map_minus_fix_east_m,"
      "map_minus_fix_north_m,map_minus_fix_up_m,weight\n";
  for (size_t c = 0; c < world.components.size(); ++c) {
    for (const PlacementResidual& r : world.components[c].residuals) {
      const PositionFix& fix = sessions[static_cast<size_t>(r.session)].fixes[r.fix];
      text += std::to_string(r.session) + "," + std::to_string(c) + "," + FormatSeconds(r.utime);
      text += Format(",%.8f,%.8f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f\n", fix.latitude_deg, fix.longitude_deg,
                     fix.altitude_m, r.enu.x(), r.enu.y(), r.enu.z(), r.residual.x(), r.residual.y(), r.residual.z(),
                     r.weight);
    }
  }
  return text;
}

}  // namespace mapmend

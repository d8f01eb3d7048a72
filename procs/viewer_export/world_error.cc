#include "procs/viewer_export/world_error.h"

#include <algorithm>
#include <cmath>

#include "libs/base/median.h"
#include "libs/base/text_format.h"

namespace mapmend {

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

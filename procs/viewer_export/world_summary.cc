#include "procs/viewer_export/world_summary.h"

#include <nlohmann/json.hpp>

#include "procs/viewer_export/world_error.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson ErrorJson(const WorldError& error) {
  return {{"pairs", error.num_pairs},
          {"horizontal_rmse_m", error.rmse_horizontal_m},
          {"horizontal_median_m", error.median_horizontal_m},
          {"horizontal_max_m", error.max_horizontal_m},
          {"mean_east_m", error.mean_east_m},
          {"mean_north_m", error.mean_north_m},
          {"median_up_m", error.mean_up_m},
          {"vertical_rmse_m", error.rmse_vertical_m}};
}

OrderedJson ComponentJson(const Placement& placement) {
  OrderedJson json = {{"placed", placement.success}};
  if (!placement.problem.empty()) json["problem"] = placement.problem;
  if (!placement.success) return json;
  json["open"] = placement.open;
  json["enu_from_root"] = ToArray(placement.enu_from_map);
  json["positions"] = placement.residuals.size();
  json["outliers"] = placement.num_outliers;
  json["horizontal_residual_median_m"] = placement.median_horizontal_m;
  json["horizontal_residual_rms_m"] = placement.rms_horizontal_m;
  json["vertical_residual_median_m"] = placement.median_vertical_m;
  json["sigma_horizontal_m"] = placement.SigmaHorizontal();
  json["sigma_vertical_m"] = placement.SigmaVertical();
  json["sigma_heading_deg"] = placement.SigmaHeadingDeg();
  json["sigma_tilt_deg"] = placement.SigmaTiltDeg();
  json["sigma_scale"] = placement.SigmaScale();
  return json;
}

}  // namespace

std::string MakeWorldJson(const Snapshot& placed, const WorldPlacement& world, const WorldSummaryOptions& options) {
  OrderedJson json;
  size_t num_positions = 0;
  for (const SessionFixes& session : PositionsOf(placed)) num_positions += session.fixes.size();
  json["positions"] = num_positions;
  const Geodetic& origin = world.frame.origin();
  json["origin"] = {{"latitude_deg", origin.latitude_deg},
                    {"longitude_deg", origin.longitude_deg},
                    {"altitude_m", origin.altitude_m}};
  const UtmFrame utm(origin);
  json["utm"] = {{"name", utm.Name()}, {"epsg", utm.Epsg()}};
  if (!world.problem.empty()) json["problem"] = world.problem;
  json["clocks"] = OrderedJson::array();
  for (const ClockOffset& clock : world.clocks) {
    json["clocks"].push_back({{"offset_s", 1e-6 * static_cast<double>(clock.offset_us)}, {"sigma_s", clock.sigma_s}});
  }
  json["components"] = OrderedJson::array();
  for (size_t c = 0; c < world.components.size(); ++c) {
    OrderedJson component = ComponentJson(world.components[c]);
    if (world.components[c].success && options.ground_truth != nullptr) {
      const WorldError error = MeasureWorldError(ToTrajectory(placed.components[c].frames), world.frame,
                                                 *options.ground_truth, options.ground_truth_origin);
      if (error.num_pairs > 0) component["groundtruth"] = ErrorJson(error);
    }
    json["components"].push_back(component);
  }
  return json.dump();
}

}  // namespace mapmend

#include "libs/merging/map_positions.h"

#include <algorithm>
#include <cmath>

#include "libs/base/median.h"
#include "libs/base/text_format.h"
#include "libs/positioning/position_matching.h"

namespace mapmend {
namespace {

struct Flights {
  std::vector<SessionFixes> fixes;
  std::map<std::string, int> index;
};

Flights ListFlights(const FlightPositions& flights) {
  Flights list;
  for (const auto& [flight, fixes] : flights) {
    list.index[flight] = static_cast<int>(list.fixes.size());
    SessionFixes sorted{fixes};
    std::stable_sort(sorted.fixes.begin(), sorted.fixes.end(),
                     [](const auto& a, const auto& b) { return a.utime < b.utime; });
    const auto is_same = [](const auto& a, const auto& b) { return a.utime == b.utime; };
    sorted.fixes.erase(std::unique(sorted.fixes.begin(), sorted.fixes.end(), is_same), sorted.fixes.end());
    list.fixes.push_back(std::move(sorted));
  }
  return list;
}

struct KeyframeTime {
  TrackPoint point;
  int keyframe = 0;  // index into the map
};

std::vector<KeyframeTime> TrackOf(const MergedMap& map, const Flights& flights) {
  std::vector<KeyframeTime> track;
  for (size_t k = 0; k < map.keyframes.size(); ++k) {
    const MergedKeyframe& keyframe = map.keyframes[k];
    const auto it = flights.index.find(map.submaps[keyframe.submap].flight);
    if (it == flights.index.end()) continue;
    track.push_back({{it->second, keyframe.keyframe->utime, keyframe.cam_from_root}, static_cast<int>(k)});
  }
  std::stable_sort(track.begin(), track.end(),
                   [](const KeyframeTime& a, const KeyframeTime& b) { return a.point.utime < b.point.utime; });
  return track;
}

// Standard deviations of a position grow by this where keyframes follow each other quickly.
double Correlation(const std::vector<KeyframeTime>& track, double correlated_s) {
  std::vector<double> intervals;
  for (size_t i = 1; i < track.size(); ++i)
    intervals.push_back(1e-6 * static_cast<double>(track[i].point.utime - track[i - 1].point.utime));
  return std::sqrt(std::max(1.0, correlated_s / std::max(0.01, Median(intervals))));
}

}  // namespace

MapPositions FindMapPositions(const MergedMap& map, const FlightPositions& flights, const MapPositionOptions& options) {
  MapPositions result;
  const Flights list = ListFlights(flights);
  const std::vector<KeyframeTime> track = TrackOf(map, list);
  if (track.empty()) return result;
  std::vector<TrackPoint> points;
  for (const KeyframeTime& k : track) points.push_back(k.point);
  const WorldPlacement world = PlaceComponents({points}, list.fixes, options.placement);
  const Placement& placement = world.components.empty() ? Placement() : world.components[0];
  if (!placement.success || !placement.open.empty()) {
    result.told = "positions are not used: " + (placement.problem.empty() ? world.problem : placement.problem);
    return result;
  }
  const Similarity3 map_from_enu = placement.enu_from_map.Inverse();
  const Eigen::Matrix3d enu_from_map =
      placement.enu_from_map.scale * placement.enu_from_map.rotation.toRotationMatrix();
  const double correlation = Correlation(track, options.placement.correlated_s);
  const double horizontal = std::max(options.min_sigma_m, placement.median_horizontal_m / 1.177);
  const double vertical = std::max(2 * options.min_sigma_m, placement.median_vertical_m / 0.674);
  for (size_t s = 0; s < list.fixes.size(); ++s) {
    std::vector<Eigen::Vector3d> enus;
    for (const PositionFix& fix : list.fixes[s].fixes)
      enus.push_back(world.frame.ToEnu(
          {fix.latitude_deg, fix.longitude_deg, fix.HasAltitude() ? fix.altitude_m : world.frame.origin().altitude_m}));
    for (const KeyframeTime& k : track) {
      if (k.point.session != static_cast<int>(s)) continue;
      const auto pair = PositionAt(k.point, list.fixes[s], enus, world.clocks[s].offset_us, options.placement);
      if (!pair) continue;
      // What is far off is a wrong fix, or a part of the map that is: neither is to bend the rest.
      const Eigen::Vector3d off = placement.enu_from_map * pair->map - pair->enu;
      if (off.head<2>().norm() > 10 * horizontal * correlation) continue;
      PositionPrior prior;
      prior.pose = k.keyframe;
      prior.position = map_from_enu * pair->enu;
      const Eigen::Vector3d sigmas(horizontal, horizontal, std::max(vertical, pair->sigma_vertical > 20 ? 30.0 : 0));
      prior.whitening = (correlation * sigmas).cwiseInverse().asDiagonal() * enu_from_map;
      result.priors.push_back(prior);
    }
  }
  if (static_cast<int>(result.priors.size()) < options.min_positions) result.priors.clear();
  result.told = Format("%zu keyframes have positions, %.2f m beside them (median)", result.priors.size(),
                       placement.median_horizontal_m);
  return result;
}

}  // namespace mapmend

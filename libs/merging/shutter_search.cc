#include "libs/merging/shutter_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/text_format.h"
#include "libs/optim/bundle_adjuster.h"
#include "libs/optim/calibration.h"

namespace mapmend {
namespace {

constexpr int kHalves = 2;

// The submaps of one session, which share a camera.
struct Flight {
  std::vector<int> submaps;
  int64_t half_utime = 0;  // later keyframes are its second half
};

std::vector<Flight> FlightsOf(const MergedMap& map) {
  std::map<std::string, Flight> by_session;
  std::map<std::string, std::vector<int64_t>> times;
  for (size_t s = 0; s < map.submaps.size(); ++s) {
    by_session[map.submaps[s].flight].submaps.push_back(static_cast<int>(s));
  }
  for (const MergedKeyframe& k : map.keyframes) times[map.submaps[k.submap].flight].push_back(k.keyframe->utime);
  std::vector<Flight> flights;
  for (auto& [session, flight] : by_session) {
    std::vector<int64_t>& of_flight = times[session];
    if (of_flight.empty()) continue;
    const auto middle = of_flight.begin() + static_cast<long>(of_flight.size() / 2);
    std::nth_element(of_flight.begin(), middle, of_flight.end());
    flight.half_utime = *middle;
    flights.push_back(std::move(flight));
  }
  return flights;
}

// What one half of a flight says.
struct HalfReadout {
  double readout = 0;
  double information = 0;  // 1/s^2, as if poses and points were known
};

// A bundle adjustment with the lines of each flight's images as given.
struct Trial {
  MergedBundle bundle;
  std::vector<ScanLines> lines;  // per flight
  bool success = false;
  std::vector<std::array<HalfReadout, kHalves>> halves;  // per flight
  std::vector<double> cost;                              // per flight

  // The mean of both halves, by what each knows.
  double Readout(size_t flight) const {
    const auto& [first, second] = halves[flight];
    return (first.readout * first.information + second.readout * second.information) /
           std::max(1e-300, first.information + second.information);
  }
};

double RobustCost(double huber, double squared) {
  return 0.5 * (squared <= huber * huber ? squared : 2 * huber * std::sqrt(squared) - huber * huber);
}

class ShutterSearch {
 public:
  ShutterSearch(const MergedBundleOptions& bundle, const ShutterSearchOptions& options, MergedMap* map)
      : bundle_options_(bundle),
        options_(options),
        map_(map),
        flights_(FlightsOf(*map)),
        flight_of_submap_(map->submaps.size(), 0) {
    bundle_options_.bundle.max_iterations = options.iterations;
    for (size_t f = 0; f < flights_.size(); ++f) {
      for (const int s : flights_[f].submaps) flight_of_submap_[s] = static_cast<int>(f);
    }
  }
  ShutterFindings Run();

 private:
  size_t FlightOf(int keyframe) const { return flight_of_submap_[map_->keyframes[keyframe].submap]; }
  // Index of a half of a flight among the readout times.
  size_t HalfOf(int keyframe) const {
    const size_t flight = FlightOf(keyframe);
    return kHalves * flight + (map_->keyframes[keyframe].keyframe->utime >= flights_[flight].half_utime ? 1 : 0);
  }
  Trial Try(const std::vector<ScanLines>& lines);
  // Lines of each flight as in that trial which explains it better.
  Trial Better(Trial rows, Trial columns);
  std::vector<double> Costs(const Trial& trial) const;
  // Empty, or why the readout time of a flight is not believed.
  std::string Refuse(const Trial& trial, size_t flight) const;
  // How much of the cost it takes away if the lens is free as well.
  double GainBesideLens(const Trial& trial, size_t flight) const;
  std::optional<double> CostWithFreeLens(const Trial& trial, size_t flight, double readout) const;

  MergedBundleOptions bundle_options_;
  const ShutterSearchOptions& options_;
  MergedMap* map_;
  std::vector<Flight> flights_;
  std::vector<int> flight_of_submap_;
  std::vector<double> cost_at_once_;  // per flight, with all lines read at once
};

Trial ShutterSearch::Try(const std::vector<ScanLines>& lines) {
  for (size_t s = 0; s < map_->shutters.size(); ++s) map_->shutters[s] = {0, lines[flight_of_submap_[s]]};
  Trial trial;
  trial.lines = lines;
  trial.bundle = MakeMergedBundle(*map_, options_.points_per_keyframe);
  BundleProblem& problem = trial.bundle.problem;
  trial.halves.resize(flights_.size());
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const Eigen::Vector3d x = problem.poses[o.pose].cam_from_world * problem.points[o.point];
    const Eigen::Vector2d correction = map_->ShutterCorrection(trial.bundle.elements[i], x);
    problem.shutter_correction.push_back(correction.cast<float>());
    const size_t half = HalfOf(o.pose);
    trial.halves[half / kHalves][half % kHalves].information += correction.squaredNorm() / (o.sigma * o.sigma);
  }
  if (cost_at_once_.empty()) cost_at_once_ = Costs(trial);
  // One camera for each half of each submap.
  const int num_submaps = static_cast<int>(map_->submaps.size());
  problem.cameras.insert(problem.cameras.end(), problem.cameras.begin(), problem.cameras.end());
  problem.readout_of_camera.resize(problem.cameras.size());
  for (int s = 0; s < num_submaps; ++s) {
    problem.readout_of_camera[s] = kHalves * flight_of_submap_[s];
    problem.readout_of_camera[num_submaps + s] = kHalves * flight_of_submap_[s] + 1;
  }
  for (size_t k = 0; k < problem.poses.size(); ++k) {
    if (HalfOf(static_cast<int>(k)) % kHalves == 1) problem.poses[k].camera += num_submaps;
  }
  problem.readouts.assign(kHalves * flights_.size(), 0);
  trial.success = BundleAdjuster().Adjust(bundle_options_.bundle, &problem).success;
  for (size_t half = 0; half < problem.readouts.size(); ++half)
    trial.halves[half / kHalves][half % kHalves].readout = problem.readouts[half];
  trial.cost = Costs(trial);
  return trial;
}

std::vector<double> ShutterSearch::Costs(const Trial& trial) const {
  const BundleProblem& problem = trial.bundle.problem;
  std::vector<double> costs(flights_.size(), 0);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    Eigen::Vector2d pixel = o.pixel;
    if (!problem.readouts.empty())
      pixel += problem.readouts[HalfOf(o.pose)] * problem.shutter_correction[i].cast<double>();
    const double squared =
        ReprojectionChi2(problem.cameras[problem.poses[o.pose].camera], problem.poses[o.pose].cam_from_world,
                         problem.points[o.point], pixel, o.sigma);
    if (std::isfinite(squared)) costs[FlightOf(o.pose)] += RobustCost(bundle_options_.bundle.huber, squared);
  }
  return costs;
}

Trial ShutterSearch::Better(Trial rows, Trial columns) {
  if (!rows.success || !columns.success) return rows.success ? rows : columns;
  std::vector<ScanLines> lines;
  for (size_t f = 0; f < flights_.size(); ++f) {
    lines.push_back(columns.cost[f] < rows.cost[f] ? ScanLines::kColumns : ScanLines::kRows);
  }
  if (lines == rows.lines) return rows;
  return lines == columns.lines ? columns : Try(lines);
}

std::optional<double> ShutterSearch::CostWithFreeLens(const Trial& trial, size_t flight, double readout) const {
  const BundleProblem& problem = trial.bundle.problem;
  CalibrationProblem lens;
  const Pinhole& ideal = map_->submaps[flights_[flight].submaps[0]].camera;
  lens.camera.width = ideal.width;
  lens.camera.height = ideal.height;
  lens.camera.fx = ideal.fx;
  lens.camera.fy = ideal.fy;
  lens.camera.cx = ideal.cx;
  lens.camera.cy = ideal.cy;
  std::vector<int> pose_of(problem.poses.size(), -1), point_of(problem.points.size(), -1);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    if (FlightOf(o.pose) != flight) continue;
    if (pose_of[o.pose] < 0) {
      pose_of[o.pose] = static_cast<int>(lens.poses.size());
      lens.poses.push_back(problem.poses[o.pose].cam_from_world);
    }
    if (point_of[o.point] < 0) {
      point_of[o.point] = static_cast<int>(lens.points.size());
      lens.points.push_back(problem.points[o.point]);
    }
    lens.observations.push_back({pose_of[o.pose], point_of[o.point],
                                 o.pixel + readout * problem.shutter_correction[i].cast<double>(), o.sigma});
  }
  CalibrationOptions calibration;
  calibration.max_iterations = options_.lens_iterations;
  calibration.huber = bundle_options_.bundle.huber;
  return mapmend::CostWithFreeLens(calibration, lens);
}

double ShutterSearch::GainBesideLens(const Trial& trial, size_t flight) const {
  const std::optional<double> without = CostWithFreeLens(trial, flight, 0),
                              with = CostWithFreeLens(trial, flight, trial.Readout(flight));
  return without && with && *without > 0 ? (*without - *with) / *without : 0;
}

std::string ShutterSearch::Refuse(const Trial& trial, size_t flight) const {
  const double readout = trial.Readout(flight), drop = cost_at_once_[flight] - trial.cost[flight];
  if (drop < options_.min_gain * cost_at_once_[flight] || drop < options_.min_drop)
    return Format("explains %.1f %% of the errors", 100 * drop / std::max(1e-300, cost_at_once_[flight]));
  if (std::abs(readout) < options_.min_readout) return "next to nothing";
  if (std::abs(readout) > options_.max_readout) return "longer than there are";
  const auto& [first, second] = trial.halves[flight];
  const double least = std::min(first.information, second.information),
               difference = std::abs(first.readout - second.readout);
  if (least > options_.min_share_of_half * (first.information + second.information) &&
      difference > std::max(options_.min_readout, options_.max_difference * std::abs(readout))) {
    return Format("%.1f ms in the first half of the flight, %.1f ms in the second", 1e3 * first.readout,
                  1e3 * second.readout);
  }
  const double gain = GainBesideLens(trial, flight);
  if (gain < options_.min_gain_beside_lens)
    return Format("another lens explains the images as well: %.1f %% of the errors are left to it", 100 * gain);
  return "";
}

ShutterFindings ShutterSearch::Run() {
  ShutterFindings findings;
  const std::vector<Shutter> before = map_->shutters;
  const Trial trial = Better(Try(std::vector(flights_.size(), ScanLines::kRows)),
                             Try(std::vector(flights_.size(), ScanLines::kColumns)));
  std::vector<Shutter> found = before;
  for (size_t f = 0; f < flights_.size(); ++f) {
    const std::string refused = trial.success ? Refuse(trial, f) : "bundle adjustment failed";
    const Shutter shutter{trial.Readout(f), trial.lines[f]};
    findings.told += Format("%s%.1f ms along %s", f == 0 ? "" : "; ", 1e3 * shutter.readout,
                            shutter.lines == ScanLines::kRows ? "rows" : "columns");
    if (!refused.empty()) {
      findings.told += ", not taken: " + refused;
      continue;
    }
    findings.found = true;
    for (const int s : flights_[f].submaps) found[s] = shutter;
  }
  map_->shutters = found;
  if (findings.found) TakeMergedBundle(trial.bundle, bundle_options_.outlier_squared_error, map_);
  return findings;
}

}  // namespace

ShutterFindings FindShutters(const MergedBundleOptions& bundle, const ShutterSearchOptions& options, MergedMap* map) {
  return ShutterSearch(bundle, options, map).Run();
}

}  // namespace mapmend

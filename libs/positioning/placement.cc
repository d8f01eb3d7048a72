#include "libs/positioning/placement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "libs/base/degree.h"
#include "libs/base/median.h"
#include "libs/base/text_format.h"
#include "libs/positioning/position_matching.h"

namespace mapmend {
namespace {

constexpr double kOutlier = 0.25;                              // weight
constexpr double kOpenAngle = 10 * kDegree, kOpenScale = 0.1;  // standard deviations beyond which a freedom is open
constexpr double kAssumedAngle = 30 * kDegree;
constexpr size_t kMinPairs = 3;

struct Matched {
  std::vector<PositionPair> pairs;
  std::vector<int> sessions;  // per pair
};

// The mean rotation that the angles of the fixes ask for; nullopt if too few tell any.
std::optional<RotationHint> HintOfAngles(const std::vector<TrackPoint>& track, const Matched& matched,
                                         const std::vector<SessionFixes>& sessions, const PlacementOptions& options) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  int count = 0;
  for (size_t i = 0; i < matched.pairs.size(); ++i) {
    const PositionFix& fix = sessions[static_cast<size_t>(matched.sessions[i])].fixes[matched.pairs[i].fix];
    if (!fix.HasAngles()) continue;
    const auto nearest = std::min_element(track.begin(), track.end(), [&](const TrackPoint& a, const TrackPoint& b) {
      return std::abs(a.utime - matched.pairs[i].utime) < std::abs(b.utime - matched.pairs[i].utime);
    });
    const Eigen::Quaterniond rotation =
        CameraRotation(fix.yaw_deg, fix.pitch_deg, fix.roll_deg) * nearest->cam_from_map.rotation;
    sum += rotation.coeffs() * rotation.coeffs().transpose();
    ++count;
  }
  if (count < 3) return std::nullopt;
  // The mean of rotations (Markley et al., Journal of Guidance 30, 2007).
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  return RotationHint{Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3))),
                      options.sigma_angle_deg * kDegree};
}

// Where the fixes lie on a line: the turn about it that has the pictures upright or downwards, as cameras are held.
RotationHint HintOfHolding(const std::vector<TrackPoint>& track, const Similarity3& enu_from_map,
                           const Eigen::Vector3d& line) {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  for (const TrackPoint& point : track)
    low += enu_from_map.rotation * (point.cam_from_map.rotation.conjugate() * Eigen::Vector3d(0, 1, 1));
  const auto across = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d { return v - line * line.dot(v); };
  const Eigen::Vector3d from = across(low), to = across(-Eigen::Vector3d::UnitZ());
  const double angle = std::atan2(line.dot(from.cross(to)), from.dot(to));
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, line)) * enu_from_map.rotation, kAssumedAngle};
}

double DurationOf(const std::vector<PositionPair>& pairs) {
  const auto [first, last] =
      std::minmax_element(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a.utime < b.utime; });
  return 1e-6 * static_cast<double>(last->utime - first->utime);
}

Eigen::Vector3d ExtentOf(const std::vector<PositionPair>& pairs, Eigen::Matrix3d* axes) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PositionPair& pair : pairs) mean += pair.enu / static_cast<double>(pairs.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const PositionPair& pair : pairs)
    scatter += (pair.enu - mean) * (pair.enu - mean).transpose() / static_cast<double>(pairs.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  *axes = solver.eigenvectors();
  return solver.eigenvalues().cwiseMax(0).cwiseSqrt();  // ascending
}

struct OpenFreedom {
  Eigen::Vector3d axis;
  double sigma = 0;
};

OpenFreedom LeastKnownRotation(const Matrix7& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(Eigen::Matrix3d(covariance.block<3, 3>(3, 3)));
  return {solver.eigenvectors().col(2), std::sqrt(std::max(0.0, solver.eigenvalues()(2)))};
}

std::string NameOfRotation(const Eigen::Vector3d& axis) {
  return std::abs(axis.z()) > 0.8 ? "heading" : "tilt about the line of flight";
}

void FillResiduals(const Matched& matched, const SimilarityFit& fit, Placement* placement) {
  std::vector<double> horizontal, vertical;
  double sum = 0;
  int num_inliers = 0;
  for (size_t i = 0; i < matched.pairs.size(); ++i) {
    const PositionPair& pair = matched.pairs[i];
    PlacementResidual r{
        matched.sessions[i], pair.fix, pair.utime, pair.enu, placement->enu_from_map * pair.map - pair.enu,
        fit.weights[i]};
    horizontal.push_back(r.residual.head<2>().norm());
    vertical.push_back(std::abs(r.residual.z()));
    if (r.weight < kOutlier) {
      ++placement->num_outliers;
    } else {
      sum += r.residual.head<2>().squaredNorm();
      ++num_inliers;
    }
    placement->residuals.push_back(r);
  }
  placement->median_horizontal_m = Median(horizontal);
  placement->median_vertical_m = Median(vertical);
  placement->rms_horizontal_m = std::sqrt(sum / std::max(1, num_inliers));
}

// What the fixes leave open, after a hint has taken its part in it.
void TellOpen(const OpenFreedom& rotation, bool by_angles, const Matrix7& covariance, Placement* placement) {
  if (rotation.sigma > kOpenAngle && !by_angles) {
    placement->open.push_back(NameOfRotation(rotation.axis));
    placement->problem = "the positions lie on a line: the " + NameOfRotation(rotation.axis) +
                         " is open; it is assumed that pictures were taken upright or downwards";
  } else if (rotation.sigma > kOpenAngle) {
    placement->problem =
        "the positions lie on a line: the " + NameOfRotation(rotation.axis) + " is taken from the angles of the camera";
  }
  if (std::sqrt(covariance(6, 6)) > kOpenScale) {
    placement->open.emplace_back("scale");
    placement->problem += (placement->problem.empty() ? "" : "; ") +
                          Format("the scale is known to %.0f %% only", 100 * std::sqrt(covariance(6, 6)));
  }
}

Placement Place(const std::vector<TrackPoint>& track, const Matched& matched, const std::vector<SessionFixes>& sessions,
                const PlacementOptions& options) {
  Placement placement;
  const std::vector<PositionPair>& pairs = matched.pairs;
  if (pairs.size() < kMinPairs) {
    placement.problem = pairs.empty()
                            ? "no position is of the time of its frames"
                            : Format("%zu positions are too few: place, heading and scale need three", pairs.size());
    return placement;
  }
  Eigen::Matrix3d axes;
  const Eigen::Vector3d extent = ExtentOf(pairs, &axes);
  const std::optional<RotationHint> angles = HintOfAngles(track, matched, sessions, options);
  SimilarityFit fit = FitSimilarity(pairs, std::nullopt);
  if (!fit.success) {
    placement.problem = "the positions do not determine where it lies: all of them are at one place";
    return placement;
  }
  const double correlated = options.correlated_s > 0 ? DurationOf(pairs) / options.correlated_s : 1e9;
  const double inflation = std::max(1.0, static_cast<double>(pairs.size()) / std::max(3.0, correlated));
  OpenFreedom rotation = LeastKnownRotation(fit.covariance);
  rotation.sigma *= std::sqrt(inflation);
  std::optional<RotationHint> hint = angles;
  if (!hint && rotation.sigma > kOpenAngle) hint = HintOfHolding(track, fit.enu_from_map, axes.col(2));
  if (hint) {
    // Beside a line of fixes the first guess may be turned by any angle, so it begins where the hint says.
    std::optional<Similarity3> guess = fit.enu_from_map;
    if (rotation.sigma > kOpenAngle) {
      const Eigen::Vector3d center = guess->Inverse() * fit.center;
      guess->rotation = hint->enu_from_map;
      guess->translation += fit.center - *guess * center;
    }
    fit = FitSimilarity(pairs, hint, guess);
  }
  if (!fit.success) {
    placement.problem = "the positions do not determine where it lies";
    return placement;
  }
  placement.enu_from_map = fit.enu_from_map;
  placement.covariance = inflation * fit.covariance;
  placement.center = fit.center;
  FillResiduals(matched, fit, &placement);
  if (placement.median_horizontal_m > options.max_residual * extent.z() ||
      4 * static_cast<size_t>(placement.num_outliers) > 3 * pairs.size()) {
    placement.problem = Format(
        "the positions do not fit: they are %.1f m beside the map (median), over %.0f m of flight; "
        "are they of another flight?",
        placement.median_horizontal_m, 2 * extent.z());
    return placement;
  }
  TellOpen(rotation, angles.has_value(), placement.covariance, &placement);
  placement.success = true;
  return placement;
}

std::vector<std::vector<Eigen::Vector3d>> EnusOf(const std::vector<SessionFixes>& sessions, const LocalFrame& frame) {
  std::vector<std::vector<Eigen::Vector3d>> enus;
  for (const SessionFixes& session : sessions) {
    enus.emplace_back();
    for (const PositionFix& fix : session.fixes)
      enus.back().push_back(frame.ToEnu(
          {fix.latitude_deg, fix.longitude_deg, fix.HasAltitude() ? fix.altitude_m : frame.origin().altitude_m}));
  }
  return enus;
}

}  // namespace

Eigen::Quaterniond CameraRotation(double yaw_deg, double pitch_deg, double roll_deg) {
  const double yaw = yaw_deg * kDegree, pitch = pitch_deg * kDegree, roll = roll_deg * kDegree;
  const Eigen::Vector3d forward(std::sin(yaw) * std::cos(pitch), std::cos(yaw) * std::cos(pitch), std::sin(pitch));
  const Eigen::Vector3d level(std::cos(yaw), -std::sin(yaw), 0), down = forward.cross(level);
  Eigen::Matrix3d rotation;
  rotation.col(0) = std::cos(roll) * level + std::sin(roll) * down;
  rotation.col(1) = std::cos(roll) * down - std::sin(roll) * level;
  rotation.col(2) = forward;
  return Eigen::Quaterniond(rotation);
}

double Placement::SigmaHorizontal() const { return std::sqrt(0.5 * (covariance(0, 0) + covariance(1, 1))); }
double Placement::SigmaVertical() const { return std::sqrt(covariance(2, 2)); }
double Placement::SigmaHeadingDeg() const { return std::sqrt(covariance(5, 5)) / kDegree; }
double Placement::SigmaTiltDeg() const { return std::sqrt(std::max(covariance(3, 3), covariance(4, 4))) / kDegree; }
double Placement::SigmaScale() const { return std::sqrt(covariance(6, 6)); }

WorldPlacement PlaceComponents(const std::vector<std::vector<TrackPoint>>& components,
                               const std::vector<SessionFixes>& sessions, const PlacementOptions& options) {
  WorldPlacement world;
  const auto first = std::find_if(sessions.begin(), sessions.end(), [](const auto& s) { return !s.fixes.empty(); });
  if (first == sessions.end()) {
    world.problem = "no positions";
    return world;
  }
  const PositionFix& origin = first->fixes.front();
  world.frame = LocalFrame({origin.latitude_deg, origin.longitude_deg, origin.altitude_m});
  const std::vector<std::vector<Eigen::Vector3d>> enus = EnusOf(sessions, world.frame);
  for (size_t s = 0; s < sessions.size(); ++s)
    world.clocks.push_back(EstimateClockOffset(components, static_cast<int>(s), sessions[s], enus[s], options));
  for (const std::vector<TrackPoint>& track : components) {
    Matched matched;
    for (size_t s = 0; s < sessions.size(); ++s) {
      if (!world.clocks[s].problem.empty()) continue;
      for (const PositionPair& pair :
           MatchPositions(track, static_cast<int>(s), sessions[s], enus[s], world.clocks[s].offset_us, options)) {
        matched.pairs.push_back(pair);
        matched.sessions.push_back(static_cast<int>(s));
      }
    }
    world.components.push_back(Place(track, matched, sessions, options));
  }
  const bool is_any =
      std::any_of(world.components.begin(), world.components.end(), [](const auto& p) { return p.success; });
  if (is_any) return world;
  for (const ClockOffset& clock : world.clocks) {
    if (world.problem.empty()) world.problem = clock.problem;
  }
  if (world.problem.empty() && !world.components.empty()) world.problem = world.components.front().problem;
  if (world.problem.empty()) world.problem = "there is no map to be placed";
  return world;
}

}  // namespace mapmend

#include "libs/connecting/wide_connection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>

#include "libs/base/median.h"
#include "libs/base/options.h"
#include "libs/base/text_format.h"
#include "libs/connecting/connection.h"

namespace mapmend {
namespace {

// Of the inliers: how many each frame sees.
std::vector<int> CountInFrames(const WideSide& side, const WideRegistration& r, bool is_a) {
  std::vector<int> counts(side.frames.size(), 0);
  for (size_t i = 0; i < r.matches.size(); ++i) {
    if (!r.is_inlier[i]) continue;
    for (const WideObservation& o : side.tracks[is_a ? r.matches[i].track_a : r.matches[i].track_b].observations)
      ++counts[o.frame];
  }
  return counts;
}

int CountCells(const WideSide& side, const WideRegistration& r, bool is_a, int frame) {
  std::set<int> cells;
  for (size_t i = 0; i < r.matches.size(); ++i) {
    if (!r.is_inlier[i]) continue;
    for (const WideObservation& o : side.tracks[is_a ? r.matches[i].track_a : r.matches[i].track_b].observations) {
      if (o.frame != frame) continue;
      const Eigen::Vector2f& p = side.Keypoint(o).pixel;
      const int column = std::clamp(static_cast<int>(8 * p.x() / static_cast<float>(side.view.camera.width)), 0, 7);
      const int row = std::clamp(static_cast<int>(6 * p.y() / static_cast<float>(side.view.camera.height)), 0, 5);
      cells.insert(8 * row + column);
    }
  }
  return static_cast<int>(cells.size());
}

// Frames of a side with so many inliers, and how many are asked of it.
bool AgreesInFrames(const std::vector<int>& counts, const WideConnectionOptions& options, int* num) {
  *num =
      static_cast<int>(std::count_if(counts.begin(), counts.end(), [&](int n) { return n >= options.min_in_frame; }));
  return *num >= std::min(options.min_frames, static_cast<int>(counts.size()));
}

double MedianDepthInFrame(const WideSide& side, int frame) {
  std::vector<double> depths;
  for (const int t : side.track_of[frame]) {
    if (side.tracks[t].has_point) depths.push_back((side.frames[frame].cam_from_submap * side.tracks[t].point).z());
  }
  return Median(depths);
}

// Largest speed between two frames of a side, submap units a second.
double Speed(const WideSide& side) {
  double speed = 0;
  for (size_t i = 0; i + 1 < side.frames.size(); ++i) {
    const double seconds = 1e-6 * std::abs(static_cast<double>(side.frames[i + 1].utime - side.frames[i].utime));
    const Eigen::Vector3d step = side.frames[i + 1].cam_from_submap.Center() - side.frames[i].cam_from_submap.Center();
    if (seconds > 0) speed = std::max(speed, step.norm() / seconds);
  }
  return speed;
}

struct Uncertainty {
  double position = 0;  // of a's camera nearest to the gap, of the viewing distance there
  double scale = 0;     // share
};

Uncertainty Uncertain(const WideSide& a, const WideRegistration& r) {
  const Matrix7d covariance = r.information.inverse();
  double largest = 0;
  for (const int frame : {0, static_cast<int>(a.frames.size()) - 1}) {
    const Eigen::Matrix<double, 3, 7> J = PlaceJacobian(r.b_from_a, a.frames[frame].cam_from_submap.Center());
    const double sigma = std::sqrt(std::max(0.0, (J * covariance * J.transpose()).trace()));
    const double depth = std::max(r.b_from_a.scale * MedianDepthInFrame(a, frame), 1e-12);
    const double share = sigma / depth;
    largest = frame == 0 ? share : std::min(largest, share);
  }
  return {largest, std::sqrt(std::max(0.0, covariance(6, 6)))};
}

// Least distance of two cameras across the gap, units of b.
double Travel(const WideSide& a, const WideSide& b, const Similarity3& b_from_a) {
  double least = std::numeric_limits<double>::infinity();
  for (const WideFrame& f : a.frames) {
    for (const WideFrame& g : b.frames)
      least = std::min(least, (b_from_a * f.cam_from_submap.Center() - g.cam_from_submap.Center()).norm());
  }
  return least;
}

// Where keyframes of a side see a track.
void AddSightings(const WideSide& side, const WideTrack& track, bool is_in_b,
                  std::vector<WideCommonPoints::Sighting>* sightings) {
  for (const WideObservation& o : track.observations) {
    const WideFrame& frame = side.frames[o.frame];
    const WideKeypoint& keypoint = side.Keypoint(o);
    if (frame.is_keyframe)
      sightings->push_back({is_in_b, frame.keyframe, keypoint.pixel, static_cast<float>(WideSigma(keypoint))});
  }
}

// Per frame of b the frame of a with which it has most inliers in common.
std::vector<ConnectedFrames> PairFrames(const WideSide& a, const WideSide& b, const WideRegistration& r,
                                        const WideConnectionOptions& options) {
  std::map<std::pair<int, int>, std::vector<Eigen::Vector3d>> common;  // points in the frame of b
  auto shared = std::make_shared<WideCommonPoints>();
  for (size_t i = 0; i < r.matches.size(); ++i) {
    if (!r.is_inlier[i] || !(r.points[i].w() > 1e-9)) continue;
    const Eigen::Vector3d point = r.points[i].hnormalized();
    shared->in_a.push_back(point);
    AddSightings(a, a.tracks[r.matches[i].track_a], false, &shared->sightings.emplace_back());
    AddSightings(b, b.tracks[r.matches[i].track_b], true, &shared->sightings.back());
    for (const WideObservation& o : a.tracks[r.matches[i].track_a].observations) {
      for (const WideObservation& p : b.tracks[r.matches[i].track_b].observations)
        common[{p.frame, o.frame}].push_back(r.b_from_a * point);
    }
  }
  std::map<int, std::pair<int, size_t>> best;  // b's frame: a's frame, common points
  for (const auto& [frames, points] : common) {
    const auto it = best.find(frames.first);
    if (static_cast<int>(points.size()) >= options.min_in_frame &&
        (it == best.end() || points.size() > it->second.second))
      best[frames.first] = {frames.second, points.size()};
  }
  std::vector<ConnectedFrames> all;
  std::set<std::pair<KeyframeId, KeyframeId>> told;
  for (const auto& [frame_b, with] : best) {
    const WideFrame &f = a.frames[with.first], &g = b.frames[frame_b];
    if (!told.insert({f.keyframe, g.keyframe}).second) continue;  // culled ones stand for one another
    ConnectedFrames& c = all.emplace_back();
    c.success = true;
    c.keyframe_a = f.keyframe;
    c.keyframe_b = g.keyframe;
    c.b_from_a = r.b_from_a;
    c.information = r.information;
    c.num_matches = r.num_alike;
    c.num_inliers = static_cast<int>(with.second);
    c.match_rate = r.num_expected > 0 ? static_cast<double>(r.num_found) / r.num_expected : 0;
    c.median_error_px = r.median_error_px;
    c.median_angle_rad = MedianIntersectionAngle(r.b_from_a * f.cam_from_submap.Center(), g.cam_from_submap.Center(),
                                                 common.at({frame_b, with.first}));
    c.wide = shared;
  }
  return all;
}

// Empty if the registration is to be believed, else why not.
std::string Objection(const WideSide& a, const WideSide& b, const WideRegistration& r, double max_travel_s,
                      bool is_known, const WideConnectionOptions& options) {
  if (!r.success) return Format("%d features look alike, but no transform explains them", r.num_alike);
  const std::vector<int> in_a = CountInFrames(a, r, true), in_b = CountInFrames(b, r, false);
  const auto fullest = [](const std::vector<int>& counts) {
    return static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  };
  const auto [cells_far, cells] =
      std::minmax({CountCells(a, r, true, fullest(in_a)), CountCells(b, r, false, fullest(in_b))});
  int frames_a = 0, frames_b = 0;
  const bool a_agrees = AgreesInFrames(in_a, options, &frames_a), b_agrees = AgreesInFrames(in_b, options, &frames_b);
  const Uncertainty sigma = Uncertain(a, r);
  const double rate = r.num_expected > 0 ? static_cast<double>(r.num_found) / r.num_expected : 0;
  const std::string found = Format("%d of %d features that look alike speak for a transform with %.0f nats",
                                   r.num_solid, r.num_alike, r.evidence);
  if (r.num_solid < options.min_inliers) return found + Format(", but %d are needed", options.min_inliers);
  if (r.evidence < options.min_evidence) return found + Format(" (%.0f needed)", options.min_evidence);
  if (!is_known && r.rival_evidence > options.max_rival * r.evidence)
    return found + Format(", but another one has %.0f", r.rival_evidence);
  if (cells < options.min_cells || cells_far < options.min_cells_far) {
    return found + Format(", but they fill only %d and %d cells of the images (%d and %d needed)", cells, cells_far,
                          options.min_cells, options.min_cells_far);
  }
  if (!(a_agrees && b_agrees))
    return found + Format(", but only in %d and %d frames of the two sides", frames_a, frames_b);
  if (rate < options.min_match_rate)
    return found + Format(", but of %d points that should be seen only %d were found", r.num_expected, r.num_found);
  if (r.median_error_px > options.max_median_error)
    return found + Format(", but with a median error of %.1f px", r.median_error_px);
  if (!(sigma.position <= options.max_position_sigma) || !(sigma.scale <= options.max_scale_sigma)) {
    return found + Format(", but leave the position open by %.1f %% of the viewing distance and the scale by %.1f %%",
                          100 * sigma.position, 100 * sigma.scale);
  }
  if (max_travel_s >= 0) {
    const double speed = std::max(r.b_from_a.scale * Speed(a), Speed(b)), travel = Travel(a, b, r.b_from_a);
    const double limit =
        options.max_speed * speed * max_travel_s + MedianDepthInFrame(b, static_cast<int>(b.frames.size()) - 1);
    if (travel > limit) return found + Format(", but the camera would have jumped %.1f times too far", travel / limit);
  }
  return "";
}

}  // namespace

std::string WideConnectionOptions::Check() const { return CheckOptions(*this); }

WideConnection VerifyWideConnection(const WideSide& a, const WideSide& b, double max_travel_s,
                                    const WideConnectionOptions& options,
                                    const std::function<bool(const Similarity3& b_from_a)>& is_known) {
  WideConnection connection;
  const WideRegistration r = RegisterWideSides(a, b, options.registration);
  connection.reason = Objection(a, b, r, max_travel_s, is_known && is_known(r.b_from_a), options);
  if (connection.reason.empty()) connection.frames = PairFrames(a, b, r, options);
  const int num_pairs = static_cast<int>(connection.frames.size());
  if (connection.reason.empty() && num_pairs < options.min_pairs) {
    connection.reason =
        Format("only %d pairs of keyframes have enough in common (%d needed)", num_pairs, options.min_pairs);
    connection.frames.clear();
  }
  connection.success = connection.reason.empty();
  if (connection.success) {
    const Uncertainty sigma = Uncertain(a, r);
    connection.reason = Format(
        "%d common features (of %d that look alike), scale %.3f, median error %.2f px; the position is known to "
        "%.1f %% of the viewing distance, the scale to %.1f %%",
        r.num_solid, r.num_alike, r.b_from_a.scale, r.median_error_px, 100 * sigma.position, 100 * sigma.scale);
    for (ConnectedFrames& frames : connection.frames) frames.reason = connection.reason;
    return connection;
  }
  ConnectedFrames& failure = connection.frames.emplace_back();
  failure.reason = ReasonPrefix(ConnectionKind::kWide) + connection.reason;
  failure.num_matches = r.num_alike;
  failure.num_inliers = r.num_solid;
  failure.num_ransac_inliers = r.num_solid;
  failure.wide = std::make_shared<WideCommonPoints>();
  return connection;
}

}  // namespace mapmend

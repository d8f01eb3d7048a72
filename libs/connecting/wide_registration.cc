#include "libs/connecting/wide_registration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>

#include "libs/base/median.h"
#include "libs/base/options.h"
#include "libs/base/random.h"
#include "libs/connecting/wide_guided.h"

namespace mapmend {
namespace {

constexpr double kLogTwoPi = 1.8378770664093453;

struct Hypothesis {
  Similarity3 b_from_a;
  double evidence = 0;
};

// Logarithm of how much more likely it is that a point with this uncertainty is seen here than that something is seen
// anywhere in the image.
double LogRatio(const Eigen::Vector3d& point, const Eigen::Matrix3d& covariance, const WideSide& target,
                const WideObservation& o) {
  const Rigid3& cam = target.frames[o.frame].cam_from_submap;
  const Pinhole& camera = target.view.camera;
  const Eigen::Vector3d x = cam * point;
  if (!(x.z() > 1e-9)) return -std::numeric_limits<double>::infinity();
  const WideKeypoint& keypoint = target.Keypoint(o);
  const double iz = 1 / x.z(), sigma = WideSigma(keypoint);
  Eigen::Matrix<double, 2, 3> J;
  J << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  J *= cam.rotation.toRotationMatrix();
  const Eigen::Matrix2d S = J * covariance * J.transpose() + sigma * sigma * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d e = camera.Project(x) - keypoint.pixel.cast<double>();
  const double area = static_cast<double>(camera.width) * camera.height;
  return std::log(area) - kLogTwoPi - 0.5 * std::log(S.determinant()) - 0.5 * e.dot(S.inverse() * e);
}

// The same for something whose depth nobody knows: by its distance from the epipolar line.
double LogRatioOfDirections(const WideSide& a, const WideObservation& in_a, const WideSide& b,
                            const WideObservation& in_b, const Similarity3& b_from_a) {
  const Rigid3 &cam_a = a.frames[in_a.frame].cam_from_submap, &cam_b = b.frames[in_b.frame].cam_from_submap;
  const Pinhole& camera = b.view.camera;
  const Eigen::Vector3d ray = a.view.camera.Unproject(a.Keypoint(in_a).pixel.cast<double>());
  const Eigen::Vector3d direction = cam_b.rotation * (b_from_a.rotation * (cam_a.rotation.conjugate() * ray));
  const Eigen::Vector3d center = cam_b * (b_from_a * cam_a.Center());
  const Eigen::Vector3d plane = center.cross(direction);
  // The line in pixels.
  const Eigen::Vector2d normal(plane.x() / camera.fx, plane.y() / camera.fy);
  const Eigen::Vector2d pixel = b.Keypoint(in_b).pixel.cast<double>();
  const Eigen::Vector3d seen = camera.Unproject(pixel);
  const double sigma = std::hypot(WideSigma(b.Keypoint(in_b)), WideSigma(a.Keypoint(in_a)));
  const double d = plane.dot(seen) / std::max(1e-12, normal.norm()) / sigma;
  if (direction.dot(seen) < 0) return -std::numeric_limits<double>::infinity();
  const double diagonal = std::hypot(camera.width, camera.height);
  const double area = static_cast<double>(camera.width) * camera.height;
  return std::log(area / diagonal) - 0.5 * kLogTwoPi - std::log(sigma) - 0.5 * d * d;
}

double MatchEvidence(const WideSide& a, const WideSide& b, const WideTrackMatch& match, const Similarity3& b_from_a,
                     const Similarity3& a_from_b) {
  const WideTrack &ta = a.tracks[match.track_a], &tb = b.tracks[match.track_b];
  const auto transported = [](const Similarity3& t, const WideTrack& track) -> Eigen::Matrix3d {
    const Eigen::Matrix3d sR = t.scale * t.rotation.toRotationMatrix();
    return sR * track.covariance * sR.transpose();
  };
  double evidence = std::numeric_limits<double>::infinity();
  if (ta.has_point) evidence = LogRatio(b_from_a * ta.point, transported(b_from_a, ta), b, tb.observations.back());
  if (tb.has_point) {
    evidence = std::min(evidence, LogRatio(a_from_b * tb.point, transported(a_from_b, tb), a, ta.observations.back()));
  }
  if (ta.has_point || tb.has_point) return evidence;
  return LogRatioOfDirections(a, ta.observations.back(), b, tb.observations.back(), b_from_a);
}

// Matches whose track in the source has a point, by the frames of the target that see them.
struct Samples {
  std::vector<std::vector<int>> by_frame;  // indices of matches
  std::vector<int> frames;                 // with three of them at least
};

Samples FindSamples(const WideSide& source, const WideSide& target, const std::vector<WideTrackMatch>& matches,
                    bool source_is_a) {
  Samples samples;
  samples.by_frame.resize(target.frames.size());
  for (size_t m = 0; m < matches.size(); ++m) {
    const int s = source_is_a ? matches[m].track_a : matches[m].track_b;
    const int t = source_is_a ? matches[m].track_b : matches[m].track_a;
    if (!source.tracks[s].has_point) continue;
    for (const WideObservation& o : target.tracks[t].observations)
      samples.by_frame[o.frame].push_back(static_cast<int>(m));
  }
  for (size_t f = 0; f < samples.by_frame.size(); ++f) {
    if (samples.by_frame[f].size() >= 3) samples.frames.push_back(static_cast<int>(f));
  }
  return samples;
}

const WideObservation& SightingIn(const WideTrack& track, int frame) {
  return *std::find_if(track.observations.begin(), track.observations.end(),
                       [&](const WideObservation& o) { return o.frame == frame; });
}

// target_from_source by P3P on three matches; up to four.
void SolveSample(const WideSide& source, const WideSide& target, const std::vector<WideTrackMatch>& matches,
                 bool source_is_a, int frame, const std::vector<int>& sample, double max_scale,
                 std::vector<Similarity3>* out) {
  const Rigid3& cam = target.frames[frame].cam_from_submap;
  const Pinhole& camera = target.view.camera;
  std::vector<cv::Point3d> objects;
  std::vector<cv::Point2d> rays;
  for (const int m : sample) {
    const Eigen::Vector3d& p = source.tracks[source_is_a ? matches[m].track_a : matches[m].track_b].point;
    const WideTrack& t = target.tracks[source_is_a ? matches[m].track_b : matches[m].track_a];
    const Eigen::Vector3d ray = camera.Unproject(target.Keypoint(SightingIn(t, frame)).pixel.cast<double>());
    objects.emplace_back(p.x(), p.y(), p.z());
    rays.emplace_back(ray.x(), ray.y());
  }
  std::vector<cv::Mat> rotations, translations;
  const int count =
      cv::solveP3P(objects, rays, cv::Matx33d::eye(), cv::noArray(), rotations, translations, cv::SOLVEPNP_AP3P);
  for (int s = 0; s < count; ++s) {
    const Eigen::Vector3d w(rotations[s].at<double>(0), rotations[s].at<double>(1), rotations[s].at<double>(2));
    const Eigen::Vector3d t(translations[s].at<double>(0), translations[s].at<double>(1),
                            translations[s].at<double>(2));
    if (!w.allFinite() || !t.allFinite()) continue;
    const Eigen::Quaterniond q(
        Eigen::AngleAxisd(w.norm(), w.norm() > 1e-12 ? Eigen::Vector3d(w.normalized()) : Eigen::Vector3d::UnitX()));
    std::vector<double> scales;
    for (const int m : sample) {
      const WideTrack& ts = source.tracks[source_is_a ? matches[m].track_a : matches[m].track_b];
      const WideTrack& tt = target.tracks[source_is_a ? matches[m].track_b : matches[m].track_a];
      if (!tt.has_point) continue;
      const double depth = (q * ts.point + t).z(), depth_there = (cam * tt.point).z();
      if (depth > 0 && depth_there > 0) scales.push_back(depth_there / depth);
    }
    if (scales.empty()) continue;
    const double scale = Median(scales);
    if (!(scale < max_scale && scale > 1 / max_scale)) continue;
    const Eigen::Quaterniond back = cam.rotation.conjugate();
    out->push_back({scale, back * q, back * (scale * t - cam.translation)});
  }
}

std::vector<Hypothesis> Sample(const WideSide& a, const WideSide& b, const std::vector<WideTrackMatch>& matches,
                               const WideRegistrationOptions& options) {
  const Samples forth = FindSamples(a, b, matches, true), back = FindSamples(b, a, matches, false);
  Random random(options.seed);
  std::vector<Hypothesis> hypotheses;
  for (int i = 0; i < options.num_samples; ++i) {
    const bool source_is_a = i % 2 == 0;
    const Samples& samples = source_is_a ? forth : back;
    if (samples.frames.empty()) continue;
    const int frame = samples.frames[random.Below(static_cast<int>(samples.frames.size()))];
    const std::vector<int>& seen = samples.by_frame[frame];
    std::set<int> chosen;
    while (chosen.size() < 3) chosen.insert(seen[random.Below(static_cast<int>(seen.size()))]);
    std::vector<Similarity3> solutions;
    const WideSide &source = source_is_a ? a : b, &target = source_is_a ? b : a;
    SolveSample(source, target, matches, source_is_a, frame, {chosen.begin(), chosen.end()}, options.max_scale,
                &solutions);
    for (const Similarity3& s : solutions) {
      const Similarity3 b_from_a = source_is_a ? s : s.Inverse();
      hypotheses.push_back({b_from_a, WideEvidence(a, b, matches, b_from_a, options.least_evidence)});
    }
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const Hypothesis& l, const Hypothesis& r) { return l.evidence > r.evidence; });
  return hypotheses;
}

// Median depth of the points that a frame sees.
double ViewingDistance(const WideSide& side, int frame) {
  std::vector<double> depths;
  for (const int t : side.track_of[frame]) {
    if (side.tracks[t].has_point) depths.push_back((side.frames[frame].cam_from_submap * side.tracks[t].point).z());
  }
  return depths.empty() ? 1 : Median(depths);
}

// By where they put the last frame of a.
bool AreSame(const WideSide& a, const Similarity3& l, const Similarity3& r, double distance,
             const WideRegistrationOptions& options) {
  const Eigen::Vector3d center = a.frames.back().cam_from_submap.Center();
  const double moved = (l * center - r * center).norm() / std::min(l.scale, r.scale);
  return moved < options.same_position * distance &&
         RotationAngle(l.rotation * r.rotation.conjugate()) < options.same_turn_deg * M_PI / 180 &&
         std::abs(std::log(l.scale / r.scale)) < options.same_scale;
}

std::vector<WideSighting> Sightings(const WideSide& side, const WideTrack& track) {
  std::vector<WideSighting> sightings;
  for (const WideObservation& o : track.observations) {
    const WideKeypoint& keypoint = side.Keypoint(o);
    sightings.push_back(
        {side.frames[o.frame].cam_from_submap, side.view.camera, keypoint.pixel.cast<double>(), WideSigma(keypoint)});
  }
  return sightings;
}

std::vector<WideCommonTrack> CommonTracks(const WideSide& a, const WideSide& b,
                                          const std::vector<WideTrackMatch>& matches) {
  std::vector<WideCommonTrack> tracks;
  for (const WideTrackMatch& m : matches)
    tracks.push_back({Sightings(a, a.tracks[m.track_a]), Sightings(b, b.tracks[m.track_b])});
  return tracks;
}

// What speaks for another hypothesis that does not speak for the best one: matches of a facade that repeats itself
// belong to the one or to the other.
double RivalEvidence(const WideSide& a, const WideSide& b, const std::vector<WideTrackMatch>& matches,
                     const Similarity3& best, const Similarity3& other, const WideRegistrationOptions& options) {
  const Similarity3 best_inverse = best.Inverse(), other_inverse = other.Inverse();
  double sum = 0;
  for (const WideTrackMatch& m : matches) {
    if (MatchEvidence(a, b, m, best, best_inverse) > options.least_evidence) continue;
    sum += std::max(0.0, MatchEvidence(a, b, m, other, other_inverse) - options.least_evidence);
  }
  return sum;
}

// What a hypothesis explains takes part in its refinement, again and again.
Hypothesis Refine(const WideSide& a, const WideSide& b, const std::vector<WideTrackMatch>& matches,
                  const std::vector<WideCommonTrack>& tracks, Hypothesis hypothesis,
                  const WideRegistrationOptions& options) {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    const Similarity3 a_from_b = hypothesis.b_from_a.Inverse();
    std::vector<char> use;
    for (const WideTrackMatch& m : matches)
      use.push_back(MatchEvidence(a, b, m, hypothesis.b_from_a, a_from_b) > options.least_evidence);
    if (std::count(use.begin(), use.end(), 1) < 4) break;
    WideAdjustmentOptions adjustment = options.adjustment;
    adjustment.max_iterations = 6;
    const WideAdjustmentResult adjusted = AdjustWide(tracks, use, hypothesis.b_from_a, adjustment);
    const double scale = adjusted.b_from_a.scale;
    if (!adjusted.success || !(scale < options.max_scale && scale > 1 / options.max_scale)) break;
    const double evidence = WideEvidence(a, b, matches, adjusted.b_from_a, options.least_evidence);
    if (!(evidence > hypothesis.evidence)) break;
    hypothesis = {adjusted.b_from_a, evidence};
  }
  return hypothesis;
}

// Matches that the transform explains keep their place; guided search adds to them what is in none.
void AddGuided(const WideSide& a, const WideSide& b, const WideRegistrationOptions& options, WideRegistration* r) {
  const Similarity3 a_from_b = r->b_from_a.Inverse();
  std::vector<char> used_a(a.tracks.size(), 0), used_b(b.tracks.size(), 0);
  std::erase_if(r->matches, [&](const WideTrackMatch& m) {
    if (MatchEvidence(a, b, m, r->b_from_a, a_from_b) <= options.least_evidence) return true;
    used_a[m.track_a] = used_b[m.track_b] = 1;
    return false;
  });
  const WideGuidedMatches guided = SearchGuided(a, b, r->b_from_a, options);
  r->num_expected = guided.num_expected;
  r->num_found = guided.num_found;
  for (const WideTrackMatch& m : guided.matches) {
    if (!used_a[m.track_a] && !used_b[m.track_b]) r->matches.push_back(m);
  }
}

// From the best hypothesis to the final transform.
void FinishRegistration(const WideSide& a, const WideSide& b, const WideRegistrationOptions& options,
                        WideRegistration* r) {
  constexpr int kRounds = 2;
  std::vector<WideTrackMatch> alike = r->matches;
  for (int round = 0; round < kRounds; ++round) {
    r->matches = alike;
    AddGuided(a, b, options, r);
    const std::vector<WideCommonTrack> tracks = CommonTracks(a, b, r->matches);
    std::vector<char> use(r->matches.size(), 1);
    constexpr int kDrops = 2;
    for (int drop = 0; drop < kDrops; ++drop) {
      if (std::count(use.begin(), use.end(), 1) < 4) return;
      const WideAdjustmentResult adjusted = AdjustWide(tracks, use, r->b_from_a, options.adjustment);
      if (!adjusted.b_from_a.translation.allFinite()) return;
      r->b_from_a = adjusted.b_from_a;
      r->information = adjusted.information;
      r->success = adjusted.success;
      r->points = adjusted.points;
      r->median_error_px = adjusted.median_error_px;
      use = r->is_inlier = adjusted.is_inlier;
    }
  }
  r->num_solid = 0;
  for (size_t i = 0; i < r->matches.size(); ++i) {
    const WideTrackMatch& m = r->matches[i];
    r->num_solid += r->is_inlier[i] && (a.tracks[m.track_a].has_point || b.tracks[m.track_b].has_point);
  }
}

}  // namespace

std::string WideRegistrationOptions::Check() const { return CheckOptions(*this); }

double WideEvidence(const WideSide& a, const WideSide& b, const std::vector<WideTrackMatch>& matches,
                    const Similarity3& b_from_a, double least_evidence) {
  const Similarity3 a_from_b = b_from_a.Inverse();
  double sum = 0;
  for (const WideTrackMatch& m : matches)
    sum += std::max(0.0, MatchEvidence(a, b, m, b_from_a, a_from_b) - least_evidence);
  return sum;
}

WideRegistration RegisterWideSides(const WideSide& a, const WideSide& b, const WideRegistrationOptions& options) {
  WideRegistration result;
  if (a.frames.empty() || b.frames.empty()) return result;
  result.matches = MatchWideSides(a, b, options);
  result.num_alike = static_cast<int>(result.matches.size());
  const std::vector<WideCommonTrack> tracks = CommonTracks(a, b, result.matches);
  const double distance = ViewingDistance(a, static_cast<int>(a.frames.size()) - 1);
  std::vector<Hypothesis> refined;
  for (const Hypothesis& h : Sample(a, b, result.matches, options)) {
    if (static_cast<int>(refined.size()) >= options.num_refined) break;
    const bool known = std::any_of(refined.begin(), refined.end(), [&](const Hypothesis& r) {
      return AreSame(a, h.b_from_a, r.b_from_a, distance, options);
    });
    if (!known) refined.push_back(Refine(a, b, result.matches, tracks, h, options));
  }
  if (refined.empty()) return result;
  std::stable_sort(refined.begin(), refined.end(),
                   [](const Hypothesis& l, const Hypothesis& r) { return l.evidence > r.evidence; });
  for (const Hypothesis& h : refined) {
    if (!AreSame(a, h.b_from_a, refined[0].b_from_a, distance, options))
      result.rival_evidence = std::max(result.rival_evidence,
                                       RivalEvidence(a, b, result.matches, refined[0].b_from_a, h.b_from_a, options));
  }
  result.evidence = refined[0].evidence;
  result.b_from_a = refined[0].b_from_a;
  FinishRegistration(a, b, options, &result);
  return result;
}

}  // namespace mapmend

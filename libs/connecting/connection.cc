#include "libs/connecting/connection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "libs/base/median.h"
#include "libs/base/text_format.h"
#include "libs/connecting/connection_strength.h"
#include "libs/connecting/seam.h"

namespace mapmend {
namespace {

// Matches as they are kept in the evidence, of some pairs of connected frames.
struct MatchesOfPairs {
  std::vector<CrossMatch> a_in_b, b_in_a;

  void Add(const ConnectedFrames& e) {
    a_in_b.insert(a_in_b.end(), e.a_in_b.begin(), e.a_in_b.end());
    b_in_a.insert(b_in_a.end(), e.b_in_a.begin(), e.b_in_a.end());
  }
};

// Evenly chosen, at most so many.
template <typename T>
std::vector<T> Thinned(const std::vector<T>& all, size_t max_size) {
  std::vector<T> thinned;
  const size_t n = std::min(all.size(), max_size);
  for (size_t i = 0; i < n; ++i) thinned.push_back(all[i * all.size() / n]);
  return thinned;
}

// Evenly chosen observations, at most so many each way: plenty for a transform, and bounded cost however much is known.
template <typename Matches>
CrossObservations ResolveSome(const SubmapView& a, const SubmapView& b, const Matches& matches, size_t max_each_way) {
  return ResolveMatches(a, b, Thinned(matches.a_in_b, max_each_way), Thinned(matches.b_in_a, max_each_way));
}

constexpr size_t kMaxProbes = 30;

// Common points (frame of a) spread over the evidence, for the cycle check.
std::vector<Eigen::Vector3d> Probes(const Connection& c, const Submap& a) {
  std::vector<Eigen::Vector3d> all;
  for (size_t i = 0; i < c.evidence.size(); ++i) {
    if (!c.agrees[i]) continue;
    for (const auto& [point, other] : c.evidence[i].common_points) {
      const auto it = a.points.find(point);
      if (it != a.points.end()) all.push_back(it->second.position.cast<double>());
    }
  }
  return Thinned(all, kMaxProbes);
}

double ViewingDistance(const Connection& c, const Submap& a) {
  for (size_t i = 0; i < c.evidence.size(); ++i) {
    if (!c.agrees[i]) continue;
    const auto it = a.keyframes.find(c.evidence[i].keyframe_a);
    if (it == a.keyframes.end()) continue;
    const double depth = MedianDepth(a, it->second);
    if (depth > 0) return depth;
  }
  return 1;
}

// Wide features have looked at the two submaps as they will stay, all frames together: there is nothing to estimate.
void EstimateWide(const Submap& a, const ConnectionOptions& options, Connection* c) {
  std::vector<double> angles;
  const ConnectedFrames* first = nullptr;
  for (size_t i = 0; i < c->evidence.size(); ++i) {
    const ConnectedFrames& e = c->evidence[i];
    c->agrees[i] = e.wide != nullptr;
    if (!c->agrees[i]) continue;
    if (first == nullptr) first = &e;
    ++c->num_connected_frames;
    angles.push_back(e.median_angle_rad * 180 / M_PI);
  }
  c->b_from_a = first->b_from_a;
  c->information = first->information;
  c->num_inliers = c->num_common_points = static_cast<int>(first->wide->in_a.size());
  c->median_error_px = first->median_error_px;
  c->median_angle_deg = std::min(Median(angles), kMaxUsefulAngleDeg);
  c->strength = ConnectionStrength(c->num_connected_frames, c->num_common_points, c->median_angle_deg);
  c->probes = Thinned(first->wide->in_a, kMaxProbes);
  c->viewing_distance = ViewingDistance(*c, a);
  c->reason = ReasonPrefix(c->kind) + first->reason;
  if (c->strength < options.min_strength) {
    c->reason += Format("; strength %.1f is below %.1f", c->strength, options.min_strength);
    return;
  }
  c->verdict = Connection::Verdict::kAccepted;
}

// Nothing that both have seen stands for it: of the paper's strength only F is left, so that everything else is taken
// first.
void EstimateMotion(const Submap& a, Connection* c) {
  const ConnectedFrames* first = nullptr;
  for (size_t i = 0; i < c->evidence.size(); ++i) {
    c->agrees[i] = c->evidence[i].by_motion;
    if (!c->agrees[i]) continue;
    if (first == nullptr) first = &c->evidence[i];
    ++c->num_connected_frames;
  }
  c->b_from_a = first->b_from_a;
  c->information = first->information;
  c->strength = ConnectionStrength(c->num_connected_frames, 0, 0);
  const auto keyframe = a.keyframes.find(first->keyframe_a);
  std::vector<Eigen::Vector3d> seen;
  if (keyframe != a.keyframes.end()) {
    for (const MapPointId id : keyframe->second.map_points) {
      if (const auto point = a.points.find(id); point != a.points.end())
        seen.push_back(point->second.position.cast<double>());
    }
  }
  c->probes = Thinned(seen, kMaxProbes);
  c->viewing_distance = ViewingDistance(*c, a);
  c->reason = ReasonPrefix(c->kind) + first->reason;
  c->verdict = Connection::Verdict::kAccepted;
}

ConnectionKind KindOfEvidence(const std::vector<ConnectedFrames>& evidence) {
  const auto any = [&](const auto& holds) { return std::any_of(evidence.begin(), evidence.end(), holds); };
  if (any([](const ConnectedFrames& e) { return e.wide != nullptr; })) return ConnectionKind::kWide;
  if (any([](const ConnectedFrames& e) { return e.by_motion; })) return ConnectionKind::kMotion;
  return ConnectionKind::kOrb;
}

// Says so where the edge leaves much open: it is used all the same, since nothing better is known.
void JudgeSeam(const Submap& a, const Submap& b, const ConnectionOptions& options, Connection* c) {
  const FarEnd far_end = FindFarEnd(a, b, c->b_from_a, TransformCovariance(c->information, c->median_error_px));
  if (far_end.share > options.max_far_end) c->reason += DescribeWeakness(far_end);
}

// Evidence that agrees with one piece of it, the leader.
struct Agreement {
  size_t leader = 0;
  std::vector<char> agrees;  // by evidence
};

// The evidence with which most inliers agree leads; the strongest few are asked.
Agreement FindAgreement(const SubmapView& a, const SubmapView& b, const std::vector<ConnectedFrames>& evidence,
                        double max_disagreement_px) {
  constexpr size_t kMaxLeaders = 8, kMaxJudged = 30;
  std::vector<CrossObservations> judged;
  judged.reserve(evidence.size());
  for (const ConnectedFrames& e : evidence) judged.push_back(ResolveSome(a, b, e, kMaxJudged));
  std::vector<size_t> strongest(evidence.size());
  std::iota(strongest.begin(), strongest.end(), size_t{0});
  std::stable_sort(strongest.begin(), strongest.end(),
                   [&](size_t l, size_t r) { return evidence[l].num_inliers > evidence[r].num_inliers; });
  strongest.resize(std::min(strongest.size(), kMaxLeaders));
  Agreement best;
  int best_support = -1;
  for (const size_t i : strongest) {
    std::vector<char> agrees(evidence.size(), 0);
    int support = 0;
    for (size_t j = 0; j < evidence.size(); ++j) {
      agrees[j] = i == j || MedianErrorPx(judged[j], evidence[i].b_from_a) <= max_disagreement_px;
      if (agrees[j]) support += evidence[j].num_inliers;
    }
    if (support > best_support) {
      best_support = support;
      best = {i, std::move(agrees)};
    }
  }
  return best;
}

// Transform, F, M, θ and C of the evidence that agrees.
void Combine(const SubmapView& a, const SubmapView& b, const ConnectionOptions& options, const ConnectedFrames& leader,
             Connection* c) {
  MatchesOfPairs all;
  std::set<std::pair<MapPointId, MapPointId>> common;
  std::vector<double> angles;
  for (size_t i = 0; i < c->evidence.size(); ++i) {
    if (!c->agrees[i]) continue;
    const ConnectedFrames& e = c->evidence[i];
    all.Add(e);
    common.insert(e.common_points.begin(), e.common_points.end());
    angles.push_back(e.median_angle_rad * 180 / M_PI);
    ++c->num_connected_frames;
  }
  // Drift bends submaps, so that no single similarity fits all evidence to a pixel: the robust loss finds the
  // compromise.
  constexpr size_t kMaxJoint = 600;
  Sim3RefinementOptions refinement = options.refinement;
  refinement.max_squared_error = options.drift_squared_error;
  const Sim3RefinementResult refined = RefineSim3(ResolveSome(a, b, all, kMaxJoint), leader.b_from_a, refinement);
  c->b_from_a = refined.success ? refined.b_from_a : leader.b_from_a;
  c->information = refined.success ? refined.information : leader.information;
  c->num_inliers = refined.success ? refined.num_inliers : leader.num_inliers;
  c->median_error_px = refined.success ? refined.median_error_px : leader.median_error_px;
  c->num_common_points = static_cast<int>(common.size());
  c->median_angle_deg = std::min(Median(angles), kMaxUsefulAngleDeg);
  c->strength = ConnectionStrength(c->num_connected_frames, c->num_common_points, c->median_angle_deg);
}

}  // namespace

EvaluatedConnection Announced(const Connection& connection) {
  EvaluatedConnection announced = connection;
  for (size_t i = 0; i < connection.evidence.size(); ++i) {
    const ConnectedFrames& e = connection.evidence[i];
    if (connection.agrees[i]) announced.pairs.push_back({e.keyframe_a, e.keyframe_b, e.num_inliers});
  }
  return announced;
}

void EstimateConnection(const SubmapView& a, const SubmapView& b, const ConnectionOptions& options, Connection* c) {
  c->num_connected_frames = c->num_common_points = c->num_inliers = 0;
  c->median_angle_deg = c->strength = c->median_error_px = 0;
  c->agrees.assign(c->evidence.size(), 0);
  c->verdict = Connection::Verdict::kRejected;
  if (c->evidence.empty()) {
    c->reason =
        Format("none of %d proposed pairs of keyframes holds; best: ", c->num_candidates) + c->best_failure.reason;
    return;
  }

  c->kind = KindOfEvidence(c->evidence);
  if (c->kind != ConnectionKind::kOrb) {
    if (c->kind == ConnectionKind::kWide) {
      EstimateWide(*a.submap, options, c);
    } else {
      EstimateMotion(*a.submap, c);
    }
    if (c->verdict == Connection::Verdict::kAccepted) JudgeSeam(*a.submap, *b.submap, options, c);
    return;
  }

  Agreement agreement = FindAgreement(a, b, c->evidence, options.max_disagreement_px);
  c->agrees = std::move(agreement.agrees);
  Combine(a, b, options, c->evidence[agreement.leader], c);
  if (c->strength < options.min_strength) {
    c->reason = Format("strength %.1f is below %.1f", c->strength, options.min_strength);
    return;
  }
  c->probes = Probes(*c, *a.submap);
  c->viewing_distance = ViewingDistance(*c, *a.submap);
  c->verdict = Connection::Verdict::kAccepted;
  c->reason =
      Format("%d connected frames (of %d looked at) with %d common map points, scale %.3f, median error %.2f px",
             c->num_connected_frames, c->num_candidates, c->num_common_points, c->b_from_a.scale, c->median_error_px);
  const int set_aside = static_cast<int>(c->evidence.size()) - c->num_connected_frames;
  if (set_aside > 0) c->reason += Format("; %d more contradict it and are set aside", set_aside);
  JudgeSeam(*a.submap, *b.submap, options, c);
}

}  // namespace mapmend

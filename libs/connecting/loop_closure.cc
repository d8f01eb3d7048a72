#include "libs/connecting/loop_closure.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "libs/base/median.h"
#include "libs/base/options.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

// Where the two keyframes of each loop stand among the keyframes of the submap.
class LoopEnds {
 public:
  LoopEnds(const Submap& submap, const std::vector<ConnectedFrames>& loops) {
    std::map<KeyframeId, int> order;
    for (const auto& [id, keyframe] : submap.keyframes) order.emplace(id, static_cast<int>(order.size()));
    for (const ConnectedFrames& loop : loops) {
      const auto a = order.find(loop.keyframe_a), b = order.find(loop.keyframe_b);
      ends_.push_back(a == order.end() || b == order.end() ? std::pair(-1, -1) : std::pair(a->second, b->second));
    }
  }

  bool Exist(int loop) const { return ends_[loop].first >= 0; }
  bool AreNeighbors(int i, int j, int max_steps) const {
    return Exist(i) && Exist(j) && std::abs(ends_[i].first - ends_[j].first) <= max_steps &&
           std::abs(ends_[i].second - ends_[j].second) <= max_steps;
  }

 private:
  std::vector<std::pair<int, int>> ends_;
};

// What one loop says about the drift of tracking between its two ends.
struct Drift {
  double way = 0;        // travelled from end to end, viewing distances
  double gap = 0;        // by which the common points are apart, median, viewing distances
  double log_scale = 0;  // absolute
  double turn_deg = 0;
};

Drift MeasureDrift(const Submap& submap, const ConnectedFrames& loop) {
  Drift drift;
  const auto first = submap.keyframes.find(std::min(loop.keyframe_a, loop.keyframe_b));
  const auto last = submap.keyframes.find(std::max(loop.keyframe_a, loop.keyframe_b));
  double depth = MedianDepth(submap, first->second);
  for (auto it = first; it != last; ++it) {
    const SubmapKeyframe &from = it->second, &to = std::next(it)->second;
    const double next_depth = MedianDepth(submap, to);
    const double distance = (from.cam_from_submap.Center() - to.cam_from_submap.Center()).norm();
    if (depth + next_depth > 0) drift.way += 2 * distance / (depth + next_depth);
    depth = next_depth;
  }
  const double viewing_distance = MedianDepth(submap, submap.keyframes.at(loop.keyframe_b));
  std::vector<double> gaps;
  for (const auto& [point, same] : loop.common_points) {
    const auto it = submap.points.find(point);
    if (it == submap.points.end()) continue;
    const Eigen::Vector3d position = it->second.position.cast<double>();
    gaps.push_back((loop.b_from_a * position - position).norm());
  }
  if (viewing_distance > 0) drift.gap = Median(std::move(gaps)) / viewing_distance;
  drift.log_scale = std::abs(std::log(loop.b_from_a.scale));
  drift.turn_deg = Eigen::AngleAxisd(loop.b_from_a.rotation).angle() * 180 / M_PI;
  return drift;
}

// Empty, or why tracking cannot have drifted so.
std::string WhyImplausible(const Drift& drift, const LoopClosureOptions& o) {
  const double max_gap = o.gap + o.gap_per_distance * drift.way;
  if (drift.gap > max_gap) {
    return Format("tracking would be off by %.2f viewing distances after a way of %.1f (at most %.2f)", drift.gap,
                  drift.way, max_gap);
  }
  const double max_log_scale = o.log_scale + o.log_scale_per_distance * drift.way;
  if (drift.log_scale > max_log_scale) {
    return Format("scale would have changed by a factor of %.2f on a way of %.1f viewing distances (at most %.2f)",
                  std::exp(drift.log_scale), drift.way, std::exp(max_log_scale));
  }
  const double max_turn = std::min(o.max_turn_deg, o.turn_deg + o.turn_deg_per_distance * drift.way);
  if (drift.turn_deg > max_turn) {
    return Format("tracking would have turned by %.1f degrees on a way of %.1f viewing distances (at most %.1f)",
                  drift.turn_deg, drift.way, max_turn);
  }
  return "";
}

// Brings tracking and some of the loops to agree, and measures what each loop has left open.
class LoopCloser {
 public:
  LoopCloser(const SubmapView& view, const std::vector<ConnectedFrames>& loops, const LoopClosureOptions& options)
      : options_(options) {
    for (const auto& [id, keyframe] : view.submap->keyframes) {
      vertex_.emplace(id, static_cast<int>(vertex_.size()));
      cam_from_submap_.emplace_back(keyframe.cam_from_submap);
    }
    AddTrackedRelations(*view.submap, 0, options.relations, &tracked_);
    for (const ConnectedFrames& loop : loops) {
      observations_.push_back(ResolveMatches(view, view, loop.a_in_b, loop.b_in_a));
      if (!vertex_.contains(loop.keyframe_a) || !vertex_.contains(loop.keyframe_b)) {
        relations_.emplace_back();
        continue;
      }
      relations_.push_back(VerifiedRelation(*view.submap, loop.keyframe_a, vertex_.at(loop.keyframe_a), *view.submap,
                                            loop.keyframe_b, vertex_.at(loop.keyframe_b), loop.b_from_a,
                                            options.relations.verified));
      // Plain least squares: a loss that lets go of large gaps would not close the loops that matter most.
      relations_.back().robust = false;
    }
  }

  double GapAsTracked(int loop) const { return MedianErrorPx(observations_[loop], Similarity3()); }

  // Per loop of `measured`, pixels (median), with all of `closed` in the pose graph; infinite if it cannot be solved.
  std::vector<double> LeftOpen(const std::vector<int>& closed, const std::vector<int>& measured) const {
    std::vector<PoseGraphEdge> edges = tracked_;
    for (const int i : closed) edges.push_back(relations_[i]);
    std::vector<Similarity3> world_from_cam;
    for (const Similarity3& t : cam_from_submap_) world_from_cam.push_back(t.Inverse());
    const bool solved = OptimizePoseGraph(edges, 0, options_.pose_graph, &world_from_cam).success;
    std::vector<double> left;
    for (const int i : measured) {
      const int a = relations_[i].a, b = relations_[i].b;
      // How the ground about each end has moved.
      const Similarity3 moved_a = world_from_cam[a] * cam_from_submap_[a],
                        moved_b = world_from_cam[b] * cam_from_submap_[b];
      left.push_back(solved ? MedianErrorPx(observations_[i], moved_b.Inverse() * moved_a)
                            : std::numeric_limits<double>::infinity());
    }
    return left;
  }

 private:
  const LoopClosureOptions& options_;
  std::map<KeyframeId, int> vertex_;
  std::vector<Similarity3> cam_from_submap_;
  std::vector<PoseGraphEdge> tracked_, relations_;
  std::vector<CrossObservations> observations_;
};

// Loops that confirm each other, directly or by others.
struct LoopPlace {
  std::vector<int> loops;
  int num_inliers = 0;
};

std::vector<LoopPlace> GroupLoops(const SubmapView& view, const std::vector<ConnectedFrames>& loops,
                                  const LoopEnds& ends, const std::vector<int>& candidates,
                                  const LoopClosureOptions& options) {
  std::vector<LoopPlace> places;
  for (const int i : candidates) {
    LoopPlace joined{{i}, loops[i].num_inliers};
    std::erase_if(places, [&](const LoopPlace& place) {
      const bool agrees = std::any_of(place.loops.begin(), place.loops.end(), [&](int j) {
        return ends.AreNeighbors(i, j, options.max_steps) && LoopsAgree(view, loops[i], loops[j], options);
      });
      if (!agrees) return false;
      joined.loops.insert(joined.loops.end(), place.loops.begin(), place.loops.end());
      joined.num_inliers += place.num_inliers;
      return true;
    });
    places.push_back(std::move(joined));
  }
  for (LoopPlace& place : places) std::sort(place.loops.begin(), place.loops.end());
  std::stable_sort(places.begin(), places.end(), [](const LoopPlace& l, const LoopPlace& r) {
    return std::pair(-l.num_inliers, l.loops[0]) < std::pair(-r.num_inliers, r.loops[0]);
  });
  return places;
}

std::vector<int> AllLoops(const std::vector<LoopPlace>& places) {
  std::vector<int> all;
  for (const LoopPlace& place : places) all.insert(all.end(), place.loops.begin(), place.loops.end());
  return all;
}

// Largest median over the places. left: per loop, in the order of AllLoops.
double LargestMedian(const std::vector<LoopPlace>& places, const std::vector<double>& left) {
  double largest = 0;
  size_t first = 0;
  for (const LoopPlace& place : places) {
    const auto begin = left.begin() + static_cast<long>(first);
    largest = std::max(largest, Median({begin, begin + static_cast<long>(place.loops.size())}));
    first += place.loops.size();
  }
  return largest;
}

// Judges the loops of one submap, step by step.
class LoopJudge {
 public:
  LoopJudge(const SubmapView& view, const std::vector<ConnectedFrames>& loops, const LoopClosureOptions& options)
      : view_(view), loops_(loops), options_(options), ends_(*view.submap, loops), closer_(view, loops, options) {
    judgement_.verdicts.assign(loops.size(), LoopVerdict::kUsed);
    judgement_.reasons.assign(loops.size(), "");
  }

  LoopJudgement Run() {
    places_ = GroupLoops(view_, loops_, ends_, Plausible(), options_);
    RefuseLone();
    MeasureGap();
    if (judgement_.is_needed) {
      const std::vector<int> all = AllLoops(places_);
      judgement_.left_px = LargestMedian(places_, closer_.LeftOpen(all, all));
      if (judgement_.left_px > options_.max_left_px) RefuseContradicting();
    }
    Explain();
    return std::move(judgement_);
  }

 private:
  void Refuse(int loop, LoopVerdict verdict, const std::string& reason) {
    judgement_.verdicts[loop] = verdict;
    judgement_.reasons[loop] = reason;
  }
  std::vector<int> Plausible();
  void RefuseLone();
  void MeasureGap();
  void RefuseContradicting();
  void Explain();

  const SubmapView& view_;
  const std::vector<ConnectedFrames>& loops_;
  const LoopClosureOptions& options_;
  const LoopEnds ends_;
  const LoopCloser closer_;
  std::vector<LoopPlace> places_;
  LoopJudgement judgement_;
};

std::vector<int> LoopJudge::Plausible() {
  std::vector<int> plausible;
  for (int i = 0; i < static_cast<int>(loops_.size()); ++i) {
    if (!ends_.Exist(i)) {
      Refuse(i, LoopVerdict::kContradicted, "one of its keyframes was culled");
      continue;
    }
    const std::string why = WhyImplausible(MeasureDrift(*view_.submap, loops_[i]), options_);
    if (why.empty())
      plausible.push_back(i);
    else
      Refuse(i, LoopVerdict::kImplausible, why);
  }
  return plausible;
}

void LoopJudge::RefuseLone() {
  std::erase_if(places_, [&](const LoopPlace& place) {
    if (place.loops.size() > 1) return false;
    Refuse(place.loops[0], LoopVerdict::kAlone, "no pair of neighbouring keyframes says the same");
    return true;
  });
}

// One loop alone does not decide: the second largest gap.
void LoopJudge::MeasureGap() {
  std::vector<double> gaps;
  for (const int i : AllLoops(places_)) gaps.push_back(closer_.GapAsTracked(i));
  std::sort(gaps.rbegin(), gaps.rend());
  judgement_.gap_px = gaps.empty() ? 0 : gaps[1];
  judgement_.is_needed = judgement_.gap_px > options_.closed_px;
}

// Some are wrong. One by one, strongest first: a place that cannot be closed together with those before is refused.
void LoopJudge::RefuseContradicting() {
  std::vector<LoopPlace> kept;
  for (const LoopPlace& place : places_) {
    std::vector<LoopPlace> with = kept;
    with.push_back(place);
    const std::vector<int> closed = AllLoops(with);
    const double left = LargestMedian(with, closer_.LeftOpen(closed, closed));
    if (left <= options_.max_left_px) {
      kept = std::move(with);
      judgement_.left_px = left;
      continue;
    }
    constexpr double kMostTold = 9999;
    const std::string why = Format("with it, loops and tracking disagree by %.0f px (at most %.0f)",
                                   std::min(left, kMostTold), options_.max_left_px);
    for (const int i : place.loops) Refuse(i, LoopVerdict::kContradicted, why);
  }
  if (kept.empty()) judgement_.left_px = 0;
  places_ = std::move(kept);
  MeasureGap();
}

void LoopJudge::Explain() {
  judgement_.num_places = static_cast<int>(places_.size());
  const int num_used = static_cast<int>(AllLoops(places_).size());
  constexpr double kMostTold = 99999;
  if (num_used == 0) {
    judgement_.reason = judgement_.reasons[0];
  } else if (!judgement_.is_needed) {
    judgement_.reason = Format("%d pairs of keyframes at %d places, closed within %.1f px as they are: nothing to gain",
                               num_used, judgement_.num_places, judgement_.gap_px);
  } else {
    judgement_.reason = Format("%d pairs of keyframes at %d places; a gap of %.1f px falls to %.1f px", num_used,
                               judgement_.num_places, std::min(judgement_.gap_px, kMostTold), judgement_.left_px);
  }
}

}  // namespace

std::string LoopClosureOptions::Check() const { return CheckOptions(*this); }

bool LoopsAgree(const SubmapView& view, const ConnectedFrames& first, const ConnectedFrames& second,
                const LoopClosureOptions& options) {
  return MedianErrorPx(ResolveMatches(view, view, first.a_in_b, first.b_in_a), second.b_from_a) <=
             options.agreement_px &&
         MedianErrorPx(ResolveMatches(view, view, second.a_in_b, second.b_in_a), first.b_from_a) <=
             options.agreement_px;
}

std::vector<int> FindLoneLoops(const SubmapView& view, const std::vector<ConnectedFrames>& loops,
                               const LoopClosureOptions& options) {
  const LoopEnds ends(*view.submap, loops);
  std::vector<int> all(loops.size()), lone;
  std::iota(all.begin(), all.end(), 0);
  for (const LoopPlace& place : GroupLoops(view, loops, ends, all, options)) {
    if (place.loops.size() == 1) lone.push_back(place.loops[0]);
  }
  std::sort(lone.begin(), lone.end());
  return lone;
}

LoopJudgement JudgeLoops(const SubmapView& view, const std::vector<ConnectedFrames>& loops,
                         const LoopClosureOptions& options) {
  if (!loops.empty()) return LoopJudge(view, loops, options).Run();
  LoopJudgement judgement;
  judgement.reason = "no place was seen twice";
  return judgement;
}

}  // namespace mapmend

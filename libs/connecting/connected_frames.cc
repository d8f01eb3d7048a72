#include "libs/connecting/connected_frames.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "libs/base/options.h"
#include "libs/base/text_format.h"
#include "libs/connecting/window_matching.h"
#include "libs/connecting/window_search.h"

namespace mapmend {
namespace {

CrossObservation MakeObservation(const Eigen::Vector3d& point, const SubmapView& target, const SubmapKeyframe& keyframe,
                                 const Eigen::Vector2f& pixel, int octave) {
  return {point, keyframe.cam_from_submap, target.camera, pixel.cast<double>(), target.pyramid.Sigma(octave)};
}

// Evenly chosen elements, at most so many, as they will be kept.
void Thin(size_t max_size, std::vector<CrossMatch>* matches) {
  const size_t n = std::min(matches->size(), max_size);
  std::vector<CrossMatch> kept;
  kept.reserve(n);
  for (size_t i = 0; i < n; ++i) kept.push_back((*matches)[i * matches->size() / n]);
  *matches = std::move(kept);
}

// Number of cells of an 8 x 6 grid that hold a feature of one of the matches in this keyframe.
int CountCells(const std::vector<CrossMatch>& matches, const SubmapKeyframe& keyframe, const Pinhole& camera) {
  std::set<int> cells;
  for (const CrossMatch& m : matches) {
    if (m.keyframe != keyframe.id) continue;
    const int column = std::clamp(static_cast<int>(8 * m.pixel.x() / static_cast<float>(camera.width)), 0, 7);
    const int row = std::clamp(static_cast<int>(6 * m.pixel.y() / static_cast<float>(camera.height)), 0, 5);
    cells.insert(8 * row + column);
  }
  return static_cast<int>(cells.size());
}

template <typename T>
std::vector<T> Select(const std::vector<T>& all, const std::vector<char>& keep) {
  std::vector<T> kept;
  for (size_t i = 0; i < all.size(); ++i) {
    if (keep[i]) kept.push_back(all[i]);
  }
  return kept;
}

// Pairs of map points that the inliers identify, each point in at most one pair.
std::vector<std::pair<MapPointId, MapPointId>> CommonPoints(const ConnectedFrames& c, const Submap& a,
                                                            const Submap& b) {
  std::map<std::pair<MapPointId, MapPointId>, int> votes;
  for (const CrossMatch& m : c.a_in_b) {
    const MapPointId other = b.keyframes.at(m.keyframe).map_points[m.feature];
    if (other.IsValid() && b.points.contains(other)) ++votes[{m.point, other}];
  }
  for (const CrossMatch& m : c.b_in_a) {
    const MapPointId other = a.keyframes.at(m.keyframe).map_points[m.feature];
    if (other.IsValid() && a.points.contains(other)) ++votes[{other, m.point}];
  }
  std::vector<std::pair<std::pair<MapPointId, MapPointId>, int>> ordered(votes.begin(), votes.end());
  std::stable_sort(ordered.begin(), ordered.end(), [](const auto& l, const auto& r) { return l.second > r.second; });
  std::set<MapPointId> used_a, used_b;
  std::vector<std::pair<MapPointId, MapPointId>> common;
  for (const auto& [pair, count] : ordered) {
    if (used_a.contains(pair.first) || used_b.contains(pair.second)) continue;
    used_a.insert(pair.first);
    used_b.insert(pair.second);
    common.push_back(pair);
  }
  std::sort(common.begin(), common.end());
  common.shrink_to_fit();
  return common;
}

// Keyframes to look at on the side that stands nearer: of its images it takes more to cover what the other's one shows.
int ZoomedWindow(double zoom, const ConnectedFramesOptions& options) {
  return std::min(options.max_window_size, static_cast<int>(std::lround(options.window_size * std::max(1.0, zoom))));
}

// In each of two images of which the one shows things so many times larger than the other: that shows a small part of
// the other's ground, and little that it resolves.
int CellsNeeded(double zoom, const ConnectedFramesOptions& options) {
  const int share = static_cast<int>(std::lround(2 * options.min_cells / std::max(zoom, 1 / zoom)));
  return std::min(options.min_cells, std::max(options.min_cells_of_zoomed, share));
}

std::vector<PointMatch> PointMatches(const std::vector<PooledMatch>& matches, const Sides& sides) {
  const SubmapView &a = sides.a.view, &b = sides.b.view;
  std::vector<PointMatch> point_matches;
  point_matches.reserve(matches.size());
  for (const PooledMatch& m : matches) {
    const Keypoint &in_a = m.keyframe_a->features.keypoints[m.feature_a],
                   &in_b = m.keyframe_b->features.keypoints[m.feature_b];
    point_matches.push_back({MakeObservation(a.submap->points.at(m.point_a).position.cast<double>(), b, *m.keyframe_b,
                                             in_b.pixel, in_b.octave),
                             MakeObservation(b.submap->points.at(m.point_b).position.cast<double>(), a, *m.keyframe_a,
                                             in_a.pixel, in_a.octave)});
  }
  return point_matches;
}

// What random sampling has found, refined on its inliers.
Similarity3 RefineSeeds(const std::vector<PointMatch>& matches, const Sim3RansacResult& ransac,
                        const Sim3RefinementOptions& options) {
  CrossObservations seeds;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (!ransac.is_inlier[i]) continue;
    seeds.a_in_b.push_back(matches[i].a_in_b);
    seeds.b_in_a.push_back(matches[i].b_in_a);
  }
  const Sim3RefinementResult refined = RefineSim3(seeds, ransac.b_from_a, options);
  return refined.success ? refined.b_from_a : ransac.b_from_a;
}

// Guided matching with a transform and refinement on what it finds, again and again: each search is narrower and
// better aimed.
struct GuidedSearchRounds {
  const ConnectedFramesOptions& options;
  Sides* sides;
  Similarity3 b_from_a;
  Sim3RefinementResult refined = {};
  int num_expected = 0, num_found = 0;  // of the map points that the two keyframes should see of each other's
  double zoom = 1;                      // size of things in the image of b, of those in a's

  // False if too few inliers are left. Keeps the matches that are inliers in the result.
  //   factor  of the search radius
  bool Search(double factor, int min_inliers, ConnectedFrames* result) {
    const SubmapView &a = sides->a.view, &b = sides->b.view;
    const SubmapKeyframe &frame_a = sides->a.Asked(), &frame_b = sides->b.Asked();
    const double radius = factor * options.search_radius;
    const GuidedMatches in_b = SearchWindow(sides->a, b_from_a, sides->b, radius, sides->same_submap, options);
    const GuidedMatches in_a =
        SearchWindow(sides->b, b_from_a.Inverse(), sides->a, radius, sides->same_submap, options);
    refined = RefineSim3(ResolveMatches(a, b, in_b.matches, in_a.matches), b_from_a, options.refinement);
    result->num_inliers = refined.num_inliers;
    if (!refined.success || refined.num_inliers < min_inliers) return false;
    b_from_a = refined.b_from_a;
    zoom = b_from_a.scale * MedianDepth(*a.submap, frame_a) * b.camera.fx /
           (MedianDepth(*b.submap, frame_b) * a.camera.fx);
    result->wanted = {ZoomedWindow(1 / zoom, options), ZoomedWindow(zoom, options)};
    result->a_in_b = Select(in_b.matches, refined.inlier_a_in_b);
    result->b_in_a = Select(in_a.matches, refined.inlier_b_in_a);
    num_expected = in_a.num_expected + in_b.num_expected;
    num_found = 0;
    for (const CrossMatch& m : result->a_in_b) num_found += m.keyframe == frame_b.id;
    for (const CrossMatch& m : result->b_in_a) num_found += m.keyframe == frame_a.id;
    return true;
  }
};

// Common points and their angle, and how much of what should be seen is found.
void Measure(const GuidedSearchRounds& search, ConnectedFrames* result) {
  const SubmapView &a = search.sides->a.view, &b = search.sides->b.view;
  result->b_from_a = search.b_from_a;
  result->information = search.refined.information;
  result->median_error_px = search.refined.median_error_px;
  result->match_rate = search.num_expected > 0 ? static_cast<double>(search.num_found) / search.num_expected : 0;
  result->common_points = CommonPoints(*result, *a.submap, *b.submap);
  std::vector<Eigen::Vector3d> common_in_b;
  for (const auto& [point_a, point_b] : result->common_points)
    common_in_b.push_back(b.submap->points.at(point_b).position.cast<double>());
  result->median_angle_rad = MedianIntersectionAngle(search.b_from_a * search.sides->a.Asked().cam_from_submap.Center(),
                                                     search.sides->b.Asked().cam_from_submap.Center(), common_in_b);
}

// Whether that is enough to believe it, and why (not).
void Judge(const GuidedSearchRounds& search, ConnectedFrames* result) {
  const ConnectedFramesOptions& options = search.options;
  const Side &side_a = search.sides->a, &side_b = search.sides->b;
  const int each_way = static_cast<int>(std::min(result->a_in_b.size(), result->b_in_a.size()));
  const int cells = std::min(CountCells(result->b_in_a, side_a.Asked(), side_a.view.camera),
                             CountCells(result->a_in_b, side_b.Asked(), side_b.view.camera));
  const int cells_needed = CellsNeeded(search.zoom, options);
  const double scale = std::max(search.b_from_a.scale, 1 / search.b_from_a.scale);
  if (each_way < options.min_inliers_each_way) {
    result->reason = Format("%d inliers, but only %d in one of the two directions (%d needed)", result->num_inliers,
                            each_way, options.min_inliers_each_way);
  } else if (static_cast<int>(result->common_points.size()) < options.min_common_points) {
    result->reason = Format("%d inliers, but only %zu map points in common (%d needed)", result->num_inliers,
                            result->common_points.size(), options.min_common_points);
  } else if (cells < cells_needed) {
    result->reason =
        Format("the %d inliers cover only %d of 48 image cells (%d needed)", result->num_inliers, cells, cells_needed);
  } else if (result->match_rate < options.min_match_rate) {
    result->reason = Format("only %.0f %% of the %d map points that should be seen are found (%.0f %% needed)",
                            100 * result->match_rate, search.num_expected, 100 * options.min_match_rate);
  } else if (result->median_error_px > options.max_median_error) {
    result->reason =
        Format("median reprojection error %.1f px (at most %.1f)", result->median_error_px, options.max_median_error);
  } else if (scale > options.max_scale) {
    result->reason =
        Format("the submaps' scales would differ by a factor of %.1f (at most %.1f)", scale, options.max_scale);
  } else {
    result->success = true;
    result->reason = Format(
        "%d reprojections agree (median %.2f px, %.0f %% of those expected), %zu common points, %d cells",
        result->num_inliers, result->median_error_px, 100 * result->match_rate, result->common_points.size(), cells);
  }
}

// From matches that agree in scale and turn to a transform, and what speaks for it.
ConnectedFrames TryHypothesis(const std::vector<PooledMatch>& matches, Sides* sides,
                              const ConnectedFramesOptions& options) {
  ConnectedFrames result;
  result.num_matches = static_cast<int>(matches.size());
  const std::vector<PointMatch> point_matches = PointMatches(matches, *sides);
  const Sim3RansacResult ransac = EstimateSim3(point_matches, options.ransac);
  result.num_ransac_inliers = ransac.num_inliers;
  if (!ransac.success) {
    result.reason = Format("%d map points look alike, but only %d agree on one transform (%d needed)",
                           result.num_matches, ransac.num_inliers, options.ransac.min_inliers);
    return result;
  }
  sides->a.Prepare(options.num_searched);
  sides->b.Prepare(options.num_searched);
  GuidedSearchRounds search{options, sides, RefineSeeds(point_matches, ransac, options.refinement)};
  std::vector<double> factors = {1.0, 0.5};
  if (ransac.num_inliers < options.min_good_seeds) factors.insert(factors.begin(), 2.0);  // few seeds aim badly
  for (size_t round = 0; round < factors.size(); ++round) {
    const int needed = round + 1 == factors.size() ? options.min_inliers : options.min_inliers / 2;
    if (search.Search(factors[round], needed, &result)) continue;
    result.reason =
        Format("%d of %d map points agree on a transform, but projecting the rest finds only %d (%d needed)",
               ransac.num_inliers, result.num_matches, result.num_inliers, options.min_inliers);
    return result;
  }
  Measure(search, &result);
  Judge(search, &result);
  Thin(options.max_kept, &result.a_in_b);
  Thin(options.max_kept, &result.b_in_a);
  return result;
}

}  // namespace

std::string ConnectedFramesOptions::Check() const { return CheckOptions(*this); }

double MedianIntersectionAngle(const Eigen::Vector3d& center_a, const Eigen::Vector3d& center_b,
                               const std::vector<Eigen::Vector3d>& points) {
  if (points.empty()) return 0;
  std::vector<double> angles;
  for (const Eigen::Vector3d& x : points) {
    const Eigen::Vector3d u = center_a - x, v = center_b - x;
    angles.push_back(std::atan2(u.cross(v).norm(), u.dot(v)));
  }
  const auto middle = angles.begin() + static_cast<long>(angles.size() / 2);
  std::nth_element(angles.begin(), middle, angles.end());
  return *middle;
}

CrossObservations ResolveMatches(const SubmapView& a, const SubmapView& b, const std::vector<CrossMatch>& a_in_b,
                                 const std::vector<CrossMatch>& b_in_a) {
  CrossObservations observations;
  const auto resolve = [](const SubmapView& owner, const SubmapView& target, const std::vector<CrossMatch>& matches,
                          std::vector<CrossObservation>* out) {
    for (const CrossMatch& m : matches) {
      const auto point = owner.submap->points.find(m.point);
      const auto keyframe = target.submap->keyframes.find(m.keyframe);
      if (point == owner.submap->points.end() || keyframe == target.submap->keyframes.end()) continue;
      out->push_back(
          MakeObservation(point->second.position.cast<double>(), target, keyframe->second, m.pixel, m.octave));
    }
  };
  resolve(a, b, a_in_b, &observations.a_in_b);
  resolve(b, a, b_in_a, &observations.b_in_a);
  return observations;
}

double MedianErrorPx(const CrossObservations& observations, const Similarity3& b_from_a) {
  const Similarity3 a_from_b = b_from_a.Inverse();
  std::vector<double> errors;
  for (const CrossObservation& o : observations.a_in_b)
    errors.push_back(o.sigma * std::sqrt(SquaredError(o, b_from_a)));
  for (const CrossObservation& o : observations.b_in_a)
    errors.push_back(o.sigma * std::sqrt(SquaredError(o, a_from_b)));
  if (errors.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = errors.begin() + static_cast<long>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return *middle;
}

ConnectedFrames VerifyConnectedFrames(const SubmapView& a, KeyframeId keyframe_a, const SubmapView& b,
                                      KeyframeId keyframe_b, const ConnectedFramesOptions& options,
                                      const WindowSizes& sizes) {
  ConnectedFrames result;
  result.keyframe_a = keyframe_a;
  result.keyframe_b = keyframe_b;
  Sides sides{{a, LocalWindow(*a.submap, keyframe_a, std::max(sizes.a, options.window_size))},
              {b, LocalWindow(*b.submap, keyframe_b, std::max(sizes.b, options.window_size))},
              a.submap == b.submap};
  if (sides.same_submap) {
    // A keyframe in both windows would vouch for itself.
    std::set<KeyframeId> in_a;
    for (const SubmapKeyframe* k : sides.a.window) in_a.insert(k->id);
    if (in_a.contains(keyframe_b)) {
      result.reason = "the two keyframes are neighbours already";
      return result;
    }
    std::erase_if(sides.b.window, [&](const SubmapKeyframe* k) { return in_a.contains(k->id); });
  }

  std::vector<PooledMatch> alike = MatchWindows(a, sides.a.window, b, sides.b.window, options.matching);
  for (int hypothesis = 0; hypothesis < options.num_hypotheses; ++hypothesis) {
    const std::vector<PooledMatch> matches = TakeAgreeing(options.matching, a.pyramid.scale_factor, &alike);
    if (static_cast<int>(matches.size()) < options.min_matches) {
      if (hypothesis == 0) {
        result.num_matches = static_cast<int>(matches.size());
        result.reason = Format("of %zu map points that look alike only %zu agree in scale and turn (%d needed)",
                               alike.size() + matches.size(), matches.size(), options.min_matches);
      }
      break;
    }
    ConnectedFrames tried = TryHypothesis(matches, &sides, options);
    tried.keyframe_a = keyframe_a;
    tried.keyframe_b = keyframe_b;
    if (tried.success) return tried;
    if (hypothesis == 0 || tried.num_inliers > result.num_inliers) result = std::move(tried);
  }
  return result;
}

}  // namespace mapmend

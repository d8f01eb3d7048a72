#include "libs/connecting/window_matching.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "libs/connecting/guided_projection.h"
#include "libs/features/matching.h"

namespace mapmend {
namespace {

// Features of a keyframe that observe a live map point.
std::vector<int> MappedFeatures(const Submap& submap, const SubmapKeyframe& keyframe) {
  std::vector<int> features;
  for (int i = 0; i < keyframe.features.Size(); ++i) {
    if (keyframe.map_points[i].IsValid() && submap.points.contains(keyframe.map_points[i])) features.push_back(i);
  }
  return features;
}

// In units of the submap; not positive if the point lies behind the camera.
double PatchSize(const SubmapView& view, const SubmapKeyframe& keyframe, int feature, MapPointId point) {
  const double depth = (keyframe.cam_from_submap * view.submap->points.at(point).position.cast<double>()).z();
  return view.pyramid.Scale(keyframe.features.keypoints[feature].octave) * depth / view.camera.fx;
}

// Turn of a keyframe's image against that of another of its window.
double ImageTurn(const SubmapKeyframe& from, const SubmapKeyframe& to) {
  return InPlaneTurn((to.cam_from_submap.rotation * from.cam_from_submap.rotation.conjugate()).toRotationMatrix());
}

}  // namespace

std::vector<PooledMatch> MatchWindows(const SubmapView& a, const KeyframeWindow& window_a, const SubmapView& b,
                                      const KeyframeWindow& window_b, const WindowMatchingOptions& options) {
  // No check of orientations here: a few matches of one pair of images do not show which turn is theirs, all together
  // do.
  const MatchOptions match_options{options.max_distance, options.ratio, true, false};
  std::vector<std::vector<int>> masks_a, masks_b;
  for (const SubmapKeyframe* k : window_a) masks_a.push_back(MappedFeatures(*a.submap, *k));
  for (const SubmapKeyframe* k : window_b) masks_b.push_back(MappedFeatures(*b.submap, *k));
  std::map<std::pair<MapPointId, MapPointId>, PooledMatch> pooled;
  for (size_t i = 0; i < window_a.size(); ++i) {
    for (size_t j = 0; j < window_b.size(); ++j) {
      // The pairs of neighbours with neighbours would add cost, and hardly a match.
      if ((i > 0 && j > 0) || masks_a[i].empty() || masks_b[j].empty()) continue;
      const SubmapKeyframe &ka = *window_a[i], &kb = *window_b[j];
      for (const Match& m :
           MatchByNodes(ka.features, ka.nodes, kb.features, kb.nodes, match_options, masks_a[i], masks_b[j])) {
        const auto key = std::pair(ka.map_points[m.a], kb.map_points[m.b]);
        if (a.submap == b.submap && key.first == key.second) continue;
        PooledMatch& match = pooled[key];
        ++match.votes;
        if (m.distance < match.distance) {
          match = {key.first, key.second, match.votes, m.distance, &ka, &kb, m.a, m.b};
        }
      }
    }
  }
  // One to one: most votes first, then the nearest descriptors; the map's order breaks ties.
  std::vector<PooledMatch> matches;
  for (const auto& [key, match] : pooled) matches.push_back(match);
  std::stable_sort(matches.begin(), matches.end(), [](const PooledMatch& l, const PooledMatch& r) {
    return std::pair(-l.votes, l.distance) < std::pair(-r.votes, r.distance);
  });
  std::set<MapPointId> used_a, used_b;
  std::erase_if(matches, [&](PooledMatch& m) {
    const double size_a = PatchSize(a, *m.keyframe_a, m.feature_a, m.point_a);
    const double size_b = PatchSize(b, *m.keyframe_b, m.feature_b, m.point_b);
    if (!(size_a > 0) || !(size_b > 0) || used_a.contains(m.point_a) || used_b.contains(m.point_b)) return true;
    used_a.insert(m.point_a);
    used_b.insert(m.point_b);
    m.log_scale = std::log(size_b / size_a);
    m.turn = m.keyframe_b->features.keypoints[m.feature_b].angle - m.keyframe_a->features.keypoints[m.feature_a].angle +
             ImageTurn(*window_a[0], *m.keyframe_a) - ImageTurn(*window_b[0], *m.keyframe_b);
    return false;
  });
  return matches;
}

std::vector<PooledMatch> TakeAgreeing(const WindowMatchingOptions& options, double pyramid_factor,
                                      std::vector<PooledMatch>* matches) {
  const double half_width = options.scale_octaves * std::log(pyramid_factor), half_turn = options.turn_deg * M_PI / 180;
  const auto agree = [&](const PooledMatch& center, const PooledMatch& m) {
    return std::abs(m.log_scale - center.log_scale) <= half_width &&
           std::abs(WrapAngle(m.turn - center.turn)) <= half_turn;
  };
  const auto weight = [&](const PooledMatch& m) {
    constexpr int kEnoughVotes = 3;
    return static_cast<double>(std::min(m.votes, kEnoughVotes)) * (1 - m.distance / (1.25 * options.max_distance));
  };
  PooledMatch best;
  double most = 0;
  for (const PooledMatch& center : *matches) {
    double sum = 0;
    for (const PooledMatch& m : *matches) sum += agree(center, m) ? weight(m) : 0;
    if (sum <= most) continue;
    most = sum;
    best = center;
  }
  std::vector<PooledMatch> agreed;
  if (most <= 0) return agreed;
  std::erase_if(*matches, [&](const PooledMatch& m) {
    if (!agree(best, m)) return false;
    agreed.push_back(m);
    return true;
  });
  return agreed;
}

}  // namespace mapmend

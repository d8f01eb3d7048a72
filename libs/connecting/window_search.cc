#include "libs/connecting/window_search.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

namespace mapmend {
namespace {

WindowAppearance Describe(const SubmapView& view, const KeyframeWindow& window) {
  WindowAppearance result;
  std::unordered_set<MapPointId> seen;
  std::vector<PointAppearance> all;
  for (size_t i = 0; i < window.size(); ++i) {
    result.rotations.push_back(window[i]->cam_from_submap.rotation);
    all.clear();
    AppendAppearances(view, *window[i], static_cast<int>(i), &all);
    for (PointAppearance& p : all) {
      if (seen.insert(p.id).second) result.points.push_back(p);
    }
  }
  return result;
}

}  // namespace

void Side::Prepare(int num_searched) {
  if (!grids.empty()) return;
  appearance = Describe(view, window);
  for (size_t i = 0; i < window.size() && i < static_cast<size_t>(num_searched); ++i) {
    grids.emplace_back(window[i]->features.keypoints, view.camera.width, view.camera.height);
  }
}

GuidedMatches SearchWindow(const Side& source, const Similarity3& target_from_source, const Side& target, double radius,
                           bool same_submap, const ConnectedFramesOptions& options) {
  ProjectionSearchOptions search;
  search.radius = radius;
  search.max_distance = options.guided_max_distance;
  search.ratio = options.guided_ratio;
  search.octave_tolerance = options.octave_tolerance;
  search.max_turn = options.max_turn_deg * M_PI / 180;
  GuidedMatches result;
  for (size_t j = 0; j < target.grids.size(); ++j) {
    const SubmapKeyframe& keyframe = *target.window[j];
    const Similarity3 cam_from_source = Similarity3(keyframe.cam_from_submap) * target_from_source;
    const ProjectionMatches found = FindByProjection(
        source.appearance.points, source.appearance.rotations, cam_from_source, target.view.camera, target.view.pyramid,
        keyframe.features.keypoints, keyframe.features.descriptors, target.grids[j], search);
    for (const ProjectionMatch& m : found.matches) {
      const MapPointId point = source.appearance.points[m.appearance].id;
      if (same_submap && keyframe.map_points[m.feature] == point) continue;
      const Keypoint& keypoint = keyframe.features.keypoints[m.feature];
      result.matches.push_back({point, keyframe.id, m.feature, keypoint.octave, keypoint.pixel});
    }
    // From far above there are fewer features than points to be seen: a feature is one point at most.
    if (j == 0) result.num_expected = std::min(found.num_visible, found.num_reachable);
  }
  return result;
}

}  // namespace mapmend

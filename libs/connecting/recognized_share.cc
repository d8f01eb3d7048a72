#include "libs/connecting/recognized_share.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

namespace mapmend {
namespace {

struct Sampled {
  const SubmapKeyframe* keyframe = nullptr;
  std::vector<Eigen::Vector3d> points;  // submap frame
  double depth = 0;                     // median, submap units
};

std::vector<Sampled> Sample(const Submap& submap, const RecognizedShareOptions& options) {
  std::vector<const SubmapKeyframe*> all;
  for (const auto& [id, keyframe] : submap.keyframes) all.push_back(&keyframe);
  std::vector<Sampled> sampled;
  const size_t n = std::min(all.size(), static_cast<size_t>(options.max_keyframes));
  for (size_t i = 0; i < n; ++i) {
    Sampled s{all[i * all.size() / n], {}, 0};
    std::vector<Eigen::Vector3d> seen;
    for (const MapPointId id : s.keyframe->map_points) {
      const auto point = id.IsValid() ? submap.points.find(id) : submap.points.end();
      if (point != submap.points.end()) seen.push_back(point->second.position.cast<double>());
    }
    s.depth = MedianDepth(submap, *s.keyframe);
    if (seen.empty() || !(s.depth > 0)) continue;
    const size_t m = std::min(seen.size(), static_cast<size_t>(options.num_samples));
    for (size_t j = 0; j < m; ++j) s.points.push_back(seen[j * seen.size() / m]);
    sampled.push_back(std::move(s));
  }
  return sampled;
}

double FractionInside(const std::vector<Eigen::Vector3d>& points, const Similarity3& target_from_source,
                      const SubmapKeyframe& keyframe, const Pinhole& camera) {
  int inside = 0;
  for (const Eigen::Vector3d& p : points) {
    const Eigen::Vector3d x = keyframe.cam_from_submap * (target_from_source * p);
    if (!(x.z() > 0)) continue;
    const Eigen::Vector2d u = camera.Project(x);
    inside += u.x() >= 0 && u.y() >= 0 && u.x() < camera.width && u.y() < camera.height;
  }
  return static_cast<double>(inside) / static_cast<double>(points.size());
}

}  // namespace

double RecognizedShare(const SubmapView& a, const SubmapView& b, const Connection& connection, int max_evidence,
                       const RecognizedShareOptions& options) {
  if (static_cast<int>(connection.evidence.size()) >= max_evidence) return 1;
  const std::vector<Sampled> in_a = Sample(*a.submap, options), in_b = Sample(*b.submap, options);
  const Similarity3 &b_from_a = connection.b_from_a, a_from_b = b_from_a.Inverse();
  const double min_cosine = std::cos(options.max_view_deg * M_PI / 180);
  std::set<KeyframeId> predicted;
  for (const Sampled& t : in_b) {
    for (const Sampled& s : in_a) {
      if (predicted.contains(t.keyframe->id)) break;
      const Eigen::Quaterniond b_from_cam = b_from_a.rotation * s.keyframe->cam_from_submap.rotation.conjugate();
      if ((t.keyframe->cam_from_submap.rotation * b_from_cam * Eigen::Vector3d::UnitZ()).z() < min_cosine) continue;
      const double zoom = b_from_a.scale * s.depth / a.camera.fx * b.camera.fx / t.depth;
      if (std::max(zoom, 1 / zoom) > options.max_zoom) continue;
      if (FractionInside(s.points, b_from_a, *t.keyframe, b.camera) < options.min_overlap ||
          FractionInside(t.points, a_from_b, *s.keyframe, a.camera) < options.min_overlap) {
        continue;
      }
      predicted.insert(t.keyframe->id);
    }
  }
  std::set<KeyframeId> missed = predicted;
  for (size_t i = 0; i < connection.evidence.size(); ++i) {
    if (connection.agrees[i]) missed.erase(connection.evidence[i].keyframe_b);
  }
  return static_cast<double>(predicted.size() - missed.size() + options.doubt) /
         static_cast<double>(predicted.size() + options.doubt);
}

}  // namespace mapmend

#include "procs/frontend/epipolar_triangulation.h"

#include <cmath>

#include "libs/geometry/chi_square.h"
#include "libs/geometry/triangulation.h"
#include "libs/optim/bundle_adjustment.h"

namespace mapmend {
namespace {

constexpr double kMinDepth = 1e-3;  // nearer than that a projection says nothing; the submap's first depth is 1
constexpr double kNoLength = 1e-6;  // pixels: a shorter segment has no direction

// Whether pixels lie near the segment from p0 to p1, with as much slack at its ends.
class SegmentTest {
 public:
  SegmentTest(const Eigen::Vector2d& p0, const Eigen::Vector2d& p1) : p0_(p0), length_((p1 - p0).norm()) {
    if (length_ >= kNoLength) direction_ = (p1 - p0) / length_;
  }
  bool IsNear(const Eigen::Vector2d& pixel, double limit) const {
    const Eigen::Vector2d d = pixel - p0_;
    if (length_ < kNoLength) return d.norm() < limit;
    const double along = d.dot(direction_), across = std::abs(d.x() * direction_.y() - d.y() * direction_.x());
    return across < limit && along > -limit && along < length_ + limit;
  }

 private:
  Eigen::Vector2d p0_, direction_ = Eigen::Vector2d::Zero();
  double length_;
};

}  // namespace

EpipolarTriangulation::EpipolarTriangulation(const LocalMapperOptions& options, const Pinhole& camera,
                                             const Pyramid& pyramid)
    : options_(options), camera_(camera), pyramid_(pyramid), max_cosine_(std::cos(options.min_angle_deg * M_PI / 180)) {
  limits_.reserve(pyramid.num_levels);
  for (int octave = 0; octave < pyramid.num_levels; ++octave) limits_.push_back(kChi1Dof95 * pyramid.Sigma(octave));
}

std::vector<NewPoint> EpipolarTriangulation::FindPoints(const WorkingKeyframe& a, const WorkingKeyframe& b,
                                                        const DepthRange& depths) const {
  const Rigid3 b_from_a = b.cam_from_submap * a.cam_from_submap.Inverse();
  const View view = {a, b, depths, b_from_a, b_from_a.rotation.toRotationMatrix()};
  struct Candidate {
    int distance = -1;
    FeatureIndex feature;
    Eigen::Vector3d position;
  };
  std::vector<Candidate> claimed(b.frame->features.Size());  // by feature of b
  const bool are_photos = a.frame->photo && b.frame->photo;
  const std::vector<Found> alike = are_photos ? FindAlike(view) : std::vector<Found>();
  for (FeatureIndex i(0); i < a.frame->features.Size(); ++i) {
    if (!a.points[i].IsNone()) continue;
    const Eigen::Vector3d ray = camera_.Unproject(a.frame->features.keypoints[i].pixel.cast<double>());
    const Found found = are_photos ? alike[i] : SearchAlongLine(view, i, ray);
    if (found.feature.IsNone()) continue;
    const std::optional<Eigen::Vector3d> x = PointOf(view, i, ray, found.feature);
    if (!x) continue;
    Candidate& claim = claimed[found.feature];
    if (claim.feature.IsNone() || found.distance < claim.distance) claim = {found.distance, i, *x};
  }
  const Rigid3 submap_from_a = a.cam_from_submap.Inverse();
  std::vector<NewPoint> points;
  for (FeatureIndex j(0); j < b.frame->features.Size(); ++j) {
    const Candidate& candidate = claimed[j];
    if (!candidate.feature.IsNone()) points.push_back({candidate.feature, j, submap_from_a * candidate.position});
  }
  return points;
}

std::vector<EpipolarTriangulation::Found> EpipolarTriangulation::FindAlike(const View& view) {
  std::vector<Found> alike(view.a.points.size());
  for (const Match& m : MatchBruteForce(view.a.frame->features, view.b.frame->features, {})) {
    if (view.b.points[m.b].IsNone()) alike[m.a] = {FeatureIndex(m.b), m.distance};
  }
  return alike;
}

EpipolarTriangulation::Found EpipolarTriangulation::SearchAlongLine(const View& view, FeatureIndex feature,
                                                                    const Eigen::Vector3d& ray) const {
  const Eigen::Vector3d rotated = view.rotation * ray;
  const Eigen::Vector3d x0 = view.depths.near * rotated + view.b_from_a.translation;
  const Eigen::Vector3d x1 = view.depths.far * rotated + view.b_from_a.translation;
  if (x0.z() <= kMinDepth || x1.z() <= kMinDepth) return {};
  const Eigen::Vector2d p0 = camera_.Project(x0), p1 = camera_.Project(x1);
  if (!p0.allFinite() || !p1.allFinite() ||
      (p1 - p0).cwiseAbs().maxCoeff() > options_.max_search_length * camera_.width)
    return {};
  const Features& features = view.b.frame->features;
  const Descriptor& descriptor = view.a.frame->features.descriptors[feature];
  int best = -1, best_distance = options_.max_distance + 1, second = kBeyondAnyDistance;
  const SegmentTest epipolar(p0, p1);
  view.b.frame->grid.VisitAlong(p0.cast<float>(), p1.cast<float>(), static_cast<float>(limits_.back()), [&](int j) {
    if (!view.b.points[j].IsNone()) return;
    const int distance = HammingDistance(descriptor, features.descriptors[j]);
    if (distance >= second) return;  // the cheaper test first
    const Keypoint& other = features.keypoints[j];
    if (!epipolar.IsNear(other.pixel.cast<double>(), limits_[other.octave])) return;
    if (distance < best_distance) {
      second = best_distance;
      best_distance = distance;
      best = j;
    } else {
      second = distance;
    }
  });
  if (best < 0 || best_distance >= options_.ratio * second) return {};
  return {FeatureIndex(best), best_distance};
}

std::optional<Eigen::Vector3d> EpipolarTriangulation::PointOf(const View& view, FeatureIndex feature_a,
                                                              const Eigen::Vector3d& ray,
                                                              FeatureIndex feature_b) const {
  const Rigid3& b_from_a = view.b_from_a;
  const Keypoint& a = view.a.frame->features.keypoints[feature_a];
  const Keypoint& b = view.b.frame->features.keypoints[feature_b];
  const auto x = Triangulate(ray, camera_.Unproject(b.pixel.cast<double>()), b_from_a);
  if (!x || x->z() < view.depths.near || x->z() > view.depths.far) return std::nullopt;
  if (CosIntersectionAngle(*x, Eigen::Vector3d::Zero(), b_from_a.Center()) > max_cosine_) return std::nullopt;
  const double chi2_a = ReprojectionChi2(camera_, {}, *x, a.pixel.cast<double>(), pyramid_.Sigma(a.octave));
  const double chi2_b = ReprojectionChi2(camera_, b_from_a, *x, b.pixel.cast<double>(), pyramid_.Sigma(b.octave));
  if (chi2_a > options_.outlier_chi2 || chi2_b > options_.outlier_chi2) return std::nullopt;
  // The patch sizes must agree with the distances.
  const double by_distance = (b_from_a * *x).norm() / x->norm();
  const double by_octave = pyramid_.Scale(a.octave) / pyramid_.Scale(b.octave);
  if (by_distance > by_octave * options_.scale_slack || by_distance * options_.scale_slack < by_octave)
    return std::nullopt;
  return x;
}

}  // namespace mapmend

#include "libs/connecting/wide_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "libs/base/median.h"
#include "libs/geometry/skew.h"

namespace mapmend {
namespace {

using Matrix3x7 = Eigen::Matrix<double, 3, 7>;

constexpr double kBehind = 1e4;  // squared error of what lies behind a camera, sigma^2

double HuberCost(double squared, double delta) {
  return squared <= delta * delta ? squared : 2 * delta * std::sqrt(squared) - delta * delta;
}

// A place: the point that the first camera of a sees in direction (x, y, 1) at depth 1 / inverse_depth.
struct Place {
  Eigen::Vector3d parameters;  // x, y, inverse depth
};

// Homogeneous point in the frame of a, and its derivative by the parameters: linear in them.
struct Anchor {
  Eigen::Matrix3d rotation;  // a_from_cam
  Eigen::Vector3d center;

  explicit Anchor(const Rigid3& cam) : rotation(cam.rotation.conjugate().toRotationMatrix()), center(cam.Center()) {}
  Eigen::Vector4d Point(const Eigen::Vector3d& p) const {
    Eigen::Vector4d x;
    x << rotation * Eigen::Vector3d(p.x(), p.y(), 1) + p.z() * center, p.z();
    return x;
  }
  Eigen::Matrix3d ByParameters() const {
    Eigen::Matrix3d m;
    m << rotation.col(0), rotation.col(1), center;
    return m;
  }
};

struct Term {
  Eigen::Vector2d error;  // sigma
  Eigen::Matrix<double, 2, 3> by_place;
  Eigen::Matrix<double, 2, 7> by_transform;
  double weight = 1;
};

// Of a point q (homogeneous weight w) in the frame of the sighting's submap.
bool Project(const WideSighting& s, const Eigen::Vector3d& q, double w, const Eigen::Matrix3d* by_place,
             const Matrix3x7* by_transform, Term* term) {
  const Eigen::Matrix3d R = s.cam_from_submap.rotation.toRotationMatrix();
  const Eigen::Vector3d x = R * q + w * s.cam_from_submap.translation;
  if (!(x.z() > 1e-9)) return false;
  const double iz = 1 / x.z(), is = 1 / s.sigma;
  term->error = is * (s.camera.Project(x) - s.pixel);
  if (by_place == nullptr) return true;
  Eigen::Matrix<double, 2, 3> projection;
  projection << s.camera.fx * iz, 0, -s.camera.fx * x.x() * iz * iz, 0, s.camera.fy * iz,
      -s.camera.fy * x.y() * iz * iz;
  projection *= is;
  Eigen::Matrix3d dx = R * *by_place;
  dx.col(2) += s.cam_from_submap.translation;  // by the inverse depth, which is w
  term->by_place = projection * dx;
  if (by_transform != nullptr)
    term->by_transform = projection * R * *by_transform;
  else
    term->by_transform.setZero();
  return true;
}

class Problem {
 public:
  Problem(const std::vector<WideCommonTrack>& tracks, double huber) : tracks_(tracks), huber_(huber) {
    for (const WideCommonTrack& t : tracks) anchors_.emplace_back(t.in_a.front().cam_from_submap);
  }

  const Anchor& AnchorOf(size_t track) const { return anchors_[track]; }

  // Visits the terms of a track; those behind a camera as nullptr.
  template <typename Visit>
  void ForEach(size_t track, const Place& place, const Similarity3& b_from_a, bool derive, Visit visit) const {
    const Anchor& anchor = anchors_[track];
    const Eigen::Vector4d p = anchor.Point(place.parameters);
    const Eigen::Matrix3d by_place = anchor.ByParameters();
    Term term;
    for (const WideSighting& s : tracks_[track].in_a) {
      const bool ok = Project(s, p.head<3>(), p.w(), derive ? &by_place : nullptr, nullptr, &term);
      visit(ok ? Weigh(&term) : nullptr);
    }
    // x_b = e^lambda exp(omega) (s R x_a) + t + upsilon, times the homogeneous weight.
    const Eigen::Matrix3d sR = b_from_a.scale * b_from_a.rotation.toRotationMatrix();
    const Eigen::Vector3d v = sR * p.head<3>(), q = v + p.w() * b_from_a.translation;
    Eigen::Matrix3d b_by_place = sR * by_place;
    b_by_place.col(2) += b_from_a.translation;
    Matrix3x7 by_transform;
    by_transform << -Skew(v), p.w() * Eigen::Matrix3d::Identity(), v;
    for (const WideSighting& s : tracks_[track].in_b) {
      const bool ok = Project(s, q, p.w(), derive ? &b_by_place : nullptr, derive ? &by_transform : nullptr, &term);
      visit(ok ? Weigh(&term) : nullptr);
    }
  }

  double Cost(size_t track, const Place& place, const Similarity3& b_from_a) const {
    double cost = 0;
    ForEach(track, place, b_from_a, false,
            [&](const Term* t) { cost += HuberCost(t != nullptr ? t->error.squaredNorm() : kBehind, huber_); });
    return cost;
  }

 private:
  const Term* Weigh(Term* term) const {
    const double e = term->error.norm();
    term->weight = e <= huber_ ? 1 : huber_ / e;
    return term;
  }

  const std::vector<WideCommonTrack>& tracks_;
  std::vector<Anchor> anchors_;
  double huber_;
};

// Normal equations of one track.
struct TrackNormal {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 7> W = Eigen::Matrix<double, 3, 7>::Zero();
  Matrix7d C = Matrix7d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  Vector7d c = Vector7d::Zero();
};

TrackNormal MakeNormal(const Problem& problem, size_t track, const Place& place, const Similarity3& b_from_a) {
  TrackNormal n;
  problem.ForEach(track, place, b_from_a, true, [&](const Term* t) {
    if (t == nullptr) return;
    const Eigen::Matrix<double, 3, 2> P = t->weight * t->by_place.transpose();
    const Eigen::Matrix<double, 7, 2> T = t->weight * t->by_transform.transpose();
    n.H.noalias() += P.lazyProduct(t->by_place);
    n.W.noalias() += P.lazyProduct(t->by_transform);
    n.C.noalias() += T.lazyProduct(t->by_transform);
    n.g.noalias() += P.lazyProduct(t->error);
    n.c.noalias() += T.lazyProduct(t->error);
  });
  return n;
}

// Moves one place to where it fits best, the transform being as it is.
void FitPlace(const Problem& problem, size_t track, const Similarity3& b_from_a, int max_iterations, Place* place) {
  double cost = problem.Cost(track, *place, b_from_a), damping = 1e-4;
  for (int i = 0; i < max_iterations; ++i) {
    const TrackNormal n = MakeNormal(problem, track, *place, b_from_a);
    bool improved = false;
    double gain = 0;
    for (int attempt = 0; attempt < 4 && !improved; ++attempt, damping *= 10) {
      Eigen::Matrix3d H = n.H;
      H.diagonal() += damping * n.H.diagonal() + Eigen::Vector3d::Constant(1e-12);
      const Place next{place->parameters + H.ldlt().solve(-n.g)};
      if (!next.parameters.allFinite()) continue;
      const double next_cost = problem.Cost(track, next, b_from_a);
      if (!(next_cost < cost)) continue;
      gain = (cost - next_cost) / cost;
      *place = next;
      cost = next_cost;
      improved = true;
      damping /= 100;
    }
    if (!improved || gain < 1e-4) return;
  }
}

// Where the first sighting and the farthest one from it put it; at infinity if they do not say.
Place InitialPlace(const WideCommonTrack& track, const Anchor& anchor, const Similarity3& b_from_a) {
  const WideSighting& first = track.in_a.front();
  const Eigen::Vector3d ray = first.camera.Unproject(first.pixel);
  const Eigen::Vector3d direction = anchor.rotation * ray;
  double best_sine = 0, inverse_depth = 0;
  const auto consider = [&](const Eigen::Vector3d& center, const Eigen::Vector3d& other_direction) {
    const Eigen::Vector3d baseline = center - anchor.center, n = other_direction.normalized();
    const double sine = direction.normalized().cross(n).norm();
    if (sine <= best_sine) return;
    best_sine = sine;
    // depth * direction - baseline is parallel to n.
    const Eigen::Vector3d l = direction.cross(n), r = baseline.cross(n);
    const double depth = l.dot(r) / l.squaredNorm();
    inverse_depth = depth > 0 ? 1 / depth : 0;
  };
  for (const WideSighting& s : track.in_a)
    consider(s.cam_from_submap.Center(), s.cam_from_submap.rotation.conjugate() * s.camera.Unproject(s.pixel));
  const Similarity3 a_from_b = b_from_a.Inverse();
  for (const WideSighting& s : track.in_b)
    consider(a_from_b * s.cam_from_submap.Center(),
             a_from_b.rotation * (s.cam_from_submap.rotation.conjugate() * s.camera.Unproject(s.pixel)));
  return {{ray.x(), ray.y(), inverse_depth}};
}

// One step of Levenberg-Marquardt for all; false if none lowers the cost.
bool Step(const Problem& problem, const std::vector<size_t>& used, double* damping, double* cost, Similarity3* t,
          std::vector<Place>* places) {
  std::vector<TrackNormal> normals;
  normals.reserve(used.size());
  for (const size_t i : used) normals.push_back(MakeNormal(problem, i, (*places)[i], *t));
  for (int attempt = 0; attempt < 6; ++attempt, *damping *= 10) {
    Matrix7d S = Matrix7d::Zero();
    Vector7d b = Vector7d::Zero();
    std::vector<Eigen::Matrix3d> inverses;
    for (const TrackNormal& n : normals) {
      Eigen::Matrix3d H = n.H;
      H.diagonal() += *damping * n.H.diagonal() + Eigen::Vector3d::Constant(1e-12);
      inverses.push_back(H.inverse());
      S += n.C - n.W.transpose() * inverses.back() * n.W;
      b += n.c - n.W.transpose() * inverses.back() * n.g;
    }
    S.diagonal() += *damping * S.diagonal();
    const Vector7d d = S.ldlt().solve(-b);
    if (!d.allFinite()) continue;
    const Similarity3 next = Perturb(*t, d);
    std::vector<Place> moved = *places;
    double next_cost = 0;
    for (size_t k = 0; k < used.size(); ++k) {
      const Eigen::Vector3d step = -inverses[k] * (normals[k].g + normals[k].W * d);
      moved[used[k]].parameters += step;
      next_cost += problem.Cost(used[k], moved[used[k]], next);
    }
    if (!(next_cost < *cost)) continue;
    const bool goes_on = *cost - next_cost > 1e-6 * *cost;
    *t = next;
    *places = std::move(moved);
    *cost = next_cost;
    *damping = std::max(1e-9, *damping / 10);
    return goes_on;
  }
  return false;
}

double Worst(const Problem& problem, size_t track, const Place& place, const Similarity3& b_from_a) {
  double worst = 0;
  problem.ForEach(track, place, b_from_a, false,
                  [&](const Term* t) { worst = std::max(worst, t != nullptr ? t->error.squaredNorm() : kBehind); });
  return worst;
}

// Which tracks the transform explains, what they say about it, and how well they fit.
void Judge(const Problem& problem, const std::vector<WideCommonTrack>& tracks, const std::vector<Place>& places,
           double max_squared_error, WideAdjustmentResult* result) {
  const Similarity3& t = result->b_from_a;
  result->is_inlier.assign(tracks.size(), 0);
  std::vector<double> errors;
  double squares = 0, freedom = -7;
  for (size_t i = 0; i < tracks.size(); ++i) {
    result->points.push_back(problem.AnchorOf(i).Point(places[i].parameters));
    result->is_inlier[i] = Worst(problem, i, places[i], t) <= max_squared_error;
    if (!result->is_inlier[i]) continue;
    ++result->num_inliers;
    const TrackNormal n = MakeNormal(problem, i, places[i], t);
    const Eigen::Matrix3d H = n.H + 1e-12 * Eigen::Matrix3d::Identity();
    result->information += n.C - n.W.transpose() * H.inverse() * n.W;
    const size_t num_a = tracks[i].in_a.size();
    freedom += 2.0 * static_cast<double>(num_a + tracks[i].in_b.size()) - 3;
    size_t k = 0;
    problem.ForEach(i, places[i], t, false, [&](const Term* term) {
      squares += term->error.squaredNorm();
      if (k >= num_a) errors.push_back(tracks[i].in_b[k - num_a].sigma * term->error.norm());
      ++k;
    });
  }
  if (errors.empty() || freedom <= 0) return;
  result->information /= std::max(1.0, squares / freedom);
  result->median_error_px = Median(errors);
  const Eigen::LDLT<Matrix7d> ldlt(result->information);
  result->success = ldlt.isPositive() && ldlt.vectorD().minCoeff() > 1e-15 * ldlt.vectorD().maxCoeff();
}

}  // namespace

WideAdjustmentResult AdjustWide(const std::vector<WideCommonTrack>& tracks, const std::vector<char>& use,
                                const Similarity3& initial, const WideAdjustmentOptions& options) {
  WideAdjustmentResult result;
  result.b_from_a = initial;
  const Problem problem(tracks, options.huber);
  std::vector<Place> places;
  std::vector<size_t> used;
  double cost = 0, damping = 1e-4;
  constexpr int kFitIterations = 8;
  const auto place = [&](size_t i) {
    Place p = InitialPlace(tracks[i], problem.AnchorOf(i), result.b_from_a);
    FitPlace(problem, i, result.b_from_a, kFitIterations, &p);
    return p;
  };
  for (size_t i = 0; i < tracks.size(); ++i) {
    places.push_back(use[i] ? place(i) : Place{Eigen::Vector3d::Zero()});
    if (!use[i]) continue;
    used.push_back(i);
    cost += problem.Cost(i, places[i], result.b_from_a);
  }
  for (int i = 0; i < options.max_iterations && Step(problem, used, &damping, &cost, &result.b_from_a, &places); ++i) {
  }
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (!use[i]) places[i] = place(i);
  }
  Judge(problem, tracks, places, options.max_squared_error, &result);
  return result;
}

}  // namespace mapmend

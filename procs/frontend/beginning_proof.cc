#include "procs/frontend/beginning_proof.h"

#include <algorithm>
#include <limits>

#include "libs/optim/pose_optimization.h"

namespace mapmend {
namespace {

constexpr size_t kMaxKept = 12;    // earlier beginnings
constexpr size_t kMinCommon = 20;  // points

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void BeginningProof::Clear() {
  earlier_.clear();
  patience_ = -1;
}

bool BeginningProof::Weigh(Initialization* beginning) {
  if (patience_ < 0) patience_ = 0;
  const bool is_wide = beginning->median_angle_deg >= options_.certain_angle_deg;
  if (is_wide && beginning->shape_sigma <= options_.certain_sigma) return true;
  if (beginning->shape_sigma <= options_.max_sigma) {
    const Votes votes = Ask(*beginning);
    if (votes.proves && votes.in_favour > votes.against) return true;
    beginning->is_uncertain = patience_ >= options_.start_patience;
    if (beginning->is_uncertain) return true;
  }
  if (earlier_.size() == kMaxKept) earlier_.erase(earlier_.begin());
  earlier_.push_back(*beginning);
  return false;
}

// What the earlier ones with less parallax foretold.
BeginningProof::Votes BeginningProof::Ask(const Initialization& beginning) const {
  Votes votes;
  const double baseline = beginning.second_from_first.translation.norm();
  for (const Initialization& e : earlier_) {
    const double growth = baseline / e.second_from_first.translation.norm();
    if (e.first != beginning.first || e.shape_sigma > options_.max_sigma || growth < 1) continue;
    const bool agrees = Disagreement(e, beginning) <= options_.max_disagreement;
    ++(agrees ? votes.in_favour : votes.against);
    votes.proves |= agrees && growth >= options_.min_growth;
  }
  return votes;
}

double BeginningProof::Disagreement(const Initialization& earlier, const Initialization& later) const {
  std::vector<const InitialPoint*> at(later.first->features.Size(), nullptr);
  for (const InitialPoint& p : later.points) at[p.first_feature] = &p;
  std::vector<double> scales;
  std::vector<PoseObservation> observations;
  for (const InitialPoint& p : earlier.points) {
    const InitialPoint* same = at[p.first_feature];
    if (same == nullptr) continue;
    const Keypoint& keypoint = earlier.second->features.keypoints[p.second_feature];
    scales.push_back(same->position.z() / p.position.z());
    observations.push_back({same->position, keypoint.pixel.cast<double>(), pyramid_.Sigma(keypoint.octave)});
  }
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  if (scales.size() < kMinCommon) return kUnknown;
  Rigid3 expected = earlier.second_from_first;
  expected.translation *= Median(scales);
  const PoseOptimizationResult found = OptimizePose(camera_, expected, observations, {});
  if (!found.success) return kUnknown;
  const Eigen::Vector3d center = found.cam_from_world.Center();
  return (expected.Center() - center).norm() / center.norm();
}

}  // namespace mapmend

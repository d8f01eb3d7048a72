#include "procs/frontend/sparse_beginning.h"

#include <algorithm>
#include <utility>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr size_t kMaxFrames = 60;   // kept
constexpr size_t kMaxBefore = 4;  // of a new photo: those before it

Initialization BeginningOf(const PhotoPair& pair, const TwoViewCandidate& motion) {
  Initialization beginning;
  beginning.success = true;
  beginning.cause = LossReason::kNone;
  beginning.first = pair.first;
  beginning.second = pair.second;
  std::vector<double> depths;
  for (const Eigen::Vector3d& x : motion.points) depths.push_back(x.z());
  const double scale = 1 / Median(std::move(depths));
  beginning.second_from_first = motion.second_from_first;
  beginning.second_from_first.translation *= scale;
  for (size_t i = 0; i < motion.matches.size(); ++i) {
    const Match& m = pair.found[motion.matches[i]];
    beginning.points.push_back({FeatureIndex(m.a), FeatureIndex(m.b), motion.points[i] * scale});
  }
  return beginning;
}

}  // namespace

void SparseBeginning::Keep(const FramePtr& frame) {
  frames_.push_back(frame);
  AddPairs(frame);
}

void SparseBeginning::AddPairs(const FramePtr& frame) {
  while (frames_.size() > kMaxFrames) frames_.pop_front();
  const size_t begin = frames_.size() - std::min(frames_.size(), kMaxBefore + 1);
  for (size_t i = begin; i + 1 < frames_.size(); ++i) {
    PhotoPair pair = PairOf(frames_[i], frame, options_, camera_, pyramid_);
    if (getenv("DBG")) {
    fprintf(stderr, "DBG   pair %d-%d found %zu:", pair.first->index, pair.second->index, pair.found.size());
    for (auto& c : pair.motions) fprintf(stderr, " [%zu+%zu %.1fdeg R%.0f t %.2f %.2f %.2f]", c.matches.size(), c.far_matches.size(), c.median_angle_deg, 57.3*Eigen::AngleAxisd(c.second_from_first.rotation).angle(), c.second_from_first.translation.x(), c.second_from_first.translation.y(), c.second_from_first.translation.z());
    fprintf(stderr, "\n");
    }
    if (!pair.motions.empty()) pairs_.push_back(std::move(pair));
  }
  std::erase_if(pairs_, [&](const PhotoPair& p) { return p.first->index < frames_[begin]->index; });
}

SparseBeginning::Choice SparseBeginning::Decide(const PhotoPair& earlier, const PhotoPair& later) const {
  Choice choice;
  for (const TwoViewCandidate& a : earlier.motions) {
    const std::vector<double> depths_a = DepthsInSecond(earlier, a);
    for (const TwoViewCandidate& b : later.motions) {
      const DepthAgreement agreement = Compare(depths_a, DepthsInFirst(later, b), options_.max_scale_spread);
      if (getenv("DBG")) fprintf(stderr, "DBG      %d-%d-%d motion %zu %zu: %d of %d agree\n", earlier.first->index, earlier.second->index, later.second->index, &a-&earlier.motions[0], &b-&later.motions[0], agreement.num_agreeing, agreement.num_common);
      if (agreement.num_agreeing < options_.min_agreeing * agreement.num_common) continue;
      if (agreement.num_agreeing > choice.num_agreeing) {
        choice.num_rival = choice.num_agreeing;
        choice.motion = &a;
        choice.num_agreeing = agreement.num_agreeing;
      } else {
        choice.num_rival = std::max(choice.num_rival, agreement.num_agreeing);
      }
    }
  }
  return choice;
}

Initialization SparseBeginning::AddFrame(const FramePtr& frame) {
  Keep(frame);
  Initialization none;
  none.reason = LossReason::kTooFewMatches;
  for (const PhotoPair& later : pairs_) {
    if (later.second != frame) continue;
    for (const PhotoPair& earlier : pairs_) {
      if (earlier.second != later.first) continue;
      const Choice choice = Decide(earlier, later);
      if (choice.num_agreeing < options_.min_common) continue;
      if (choice.num_rival > options_.max_rival * choice.num_agreeing) {
        none.reason = none.cause = LossReason::kAmbiguous;
        continue;
      }
      return BeginningOf(earlier, *choice.motion);
    }
  }
  return none;
}

void SparseBeginning::NoteMistake(const FramePtr& first, const FramePtr& second) {
  std::erase_if(pairs_, [&](const PhotoPair& p) { return p.first == first && p.second == second; });
}

void SparseBeginning::Clear() {
  frames_.clear();
  pairs_.clear();
}

}  // namespace mapmend

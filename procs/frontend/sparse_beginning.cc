#include "procs/frontend/sparse_beginning.h"

#include <algorithm>
#include <utility>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr size_t kMaxFrames = 60;  // kept
constexpr size_t kMaxBefore = 4;   // a new photo makes pairs with so many before it

Initialization BeginningOf(const PhotoPair& pair, const TwoViewCandidate& motion) {
  Initialization beginning;
  beginning.success = true;
  beginning.cause = LossReason::kNone;
  beginning.first = pair.first;
  beginning.second = pair.second;
  std::vector<double> depths;
  depths.reserve(motion.points.size());
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

// Of the motions of the earlier pair.
MotionVote Vote(const PhotoPair& earlier, const PhotoPair& later, const PhotoPairOptions& options) {
  MotionVote vote(options);
  for (const TwoViewCandidate& a : earlier.motions) {
    const Depths depths = DepthsInSecond(earlier, a);
    for (const TwoViewCandidate& b : later.motions)
      vote.Add(a, Compare(depths, DepthsInFirst(later, b), options.max_depth_spread));
  }
  return vote;
}

}  // namespace

void SparseBeginning::Keep(const FramePtr& frame) {
  while (frames_.size() >= kMaxFrames) frames_.pop_front();
  const auto begin = frames_.end() - static_cast<long>(std::min(frames_.size(), kMaxBefore));
  std::erase_if(pairs_, [&](const PhotoPair& p) { return std::find(begin, frames_.end(), p.second) == frames_.end(); });
  for (auto before = begin; before != frames_.end(); ++before) {
    PhotoPair pair = PairOf(*before, frame, options_, camera_, pyramid_);
    if (!pair.motions.empty()) pairs_.push_back(std::move(pair));
  }
  frames_.push_back(frame);
}

Initialization SparseBeginning::AddFrame(const FramePtr& frame) {
  Keep(frame);
  Initialization none;
  none.reason = LossReason::kTooFewMatches;
  for (const PhotoPair& later : pairs_) {
    if (later.second != frame) continue;
    for (const PhotoPair& earlier : pairs_) {
      if (earlier.second != later.first) continue;
      const MotionVote vote = Vote(earlier, later, options_);
      if (vote.IsClear()) return BeginningOf(earlier, vote.Winner());
      if (vote.HasWinner()) none.reason = none.cause = LossReason::kAmbiguous;
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

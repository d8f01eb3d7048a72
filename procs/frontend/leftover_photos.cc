#include "procs/frontend/leftover_photos.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace mapmend {
namespace {

constexpr int kNumStrongest = 1000;  // features that are compared: wide features come strongest first

std::vector<int> Strongest(const Frame& frame) {
  std::vector<int> indices(std::min(kNumStrongest, frame.features.Size()));
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

}  // namespace

void LeftoverPhotos::Add(const FramePtr& frame) {
  if (std::find(frames_.begin(), frames_.end(), frame) == frames_.end()) frames_.push_back(frame);
  while (frames_.size() > static_cast<size_t>(options_.max_kept)) frames_.pop_front();
}

std::vector<FramePtr> LeftoverPhotos::Alike(const Frame& frame) const {
  const std::vector<int> strongest = Strongest(frame);
  std::vector<std::pair<int, FramePtr>> found;  // matches
  for (const FramePtr& f : frames_) {
    const std::vector<Match> matches = MatchBruteForce(frame.features, f->features, {}, strongest, Strongest(*f));
    if (static_cast<int>(matches.size()) >= options_.min_matches)
      found.emplace_back(static_cast<int>(matches.size()), f);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  if (found.size() > static_cast<size_t>(options_.max_alike)) found.resize(options_.max_alike);
  std::vector<FramePtr> alike;
  alike.reserve(found.size());
  for (auto& [count, f] : found) alike.push_back(std::move(f));
  return alike;
}

}  // namespace mapmend

#include "procs/frontend/relocaliser.h"

#include <algorithm>

#include "libs/retrieval/vocabulary.h"

namespace mapmend {

std::vector<KeyframeIndex> Relocaliser::Candidates(const WorkingMap& map, const Frame& frame) {
  if (vocabulary_ == nullptr) return {};
  while (keyframes_.size() < map.Keyframes().size()) {
    const Frame& keyframe = *map.Keyframes()[keyframes_.size()].frame;
    keyframes_.push_back(vocabulary_->Transform(keyframe.features).bow);
  }
  const BowVector bow = vocabulary_->Transform(frame.features).bow;
  struct Candidate {
    KeyframeIndex keyframe;
    int num_words = 0;
    double score = 0;
  };
  std::vector<Candidate> candidates;
  int most_words = 0;
  for (KeyframeIndex k = map.LastKeyframe(); !k.IsNone(); --k) {
    if (map.Keyframe(k).removed) continue;
    candidates.push_back({k, CountCommonWords(bow, keyframes_[k]), 0});
    most_words = std::max(most_words, candidates.back().num_words);
  }
  std::erase_if(candidates,
                [&](const Candidate& c) { return c.num_words <= options_.min_share_of_words * most_words; });
  double best_score = 0;
  for (Candidate& c : candidates) {
    c.score = BowScore(bow, keyframes_[c.keyframe]);
    best_score = std::max(best_score, c.score);
  }
  std::erase_if(candidates, [&](const Candidate& c) { return c.score < options_.min_share_of_score * best_score; });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  if (static_cast<int>(candidates.size()) > options_.max_keyframes) candidates.resize(options_.max_keyframes);
  std::vector<KeyframeIndex> found;
  found.reserve(candidates.size());
  for (const Candidate& c : candidates) found.push_back(c.keyframe);
  return found;
}

}  // namespace mapmend

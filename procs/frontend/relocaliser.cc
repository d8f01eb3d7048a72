#include "procs/frontend/relocaliser.h"

#include <algorithm>

#include "libs/retrieval/vocabulary.h"

namespace mapmend {

std::vector<int> Relocaliser::Candidates(const WorkingMap& map, const Frame& frame) {
  if (vocabulary_ == nullptr) return {};
  while (keyframes_.size() < map.Keyframes().size()) {
    const Frame& keyframe = *map.Keyframe(static_cast<int>(keyframes_.size())).frame;
    keyframes_.push_back(vocabulary_->Transform(keyframe.features).bow);
  }
  const BowVector bow = vocabulary_->Transform(frame.features).bow;
  struct Candidate {
    int keyframe = -1, num_words = 0;
    double score = 0;
  };
  std::vector<Candidate> candidates;
  int most_words = 0;
  for (int k = static_cast<int>(keyframes_.size()) - 1; k >= 0; --k) {
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
  std::vector<int> found;
  found.reserve(candidates.size());
  for (const Candidate& c : candidates) found.push_back(c.keyframe);
  return found;
}

}  // namespace mapmend

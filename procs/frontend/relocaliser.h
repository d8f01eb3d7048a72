#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/retrieval/bow_vector.h"
#include "procs/frontend/working_map.h"

namespace mapmend {

class Vocabulary;

struct RelocaliserOptions {
  double min_share_of_words = 0.8;  // of the words that the best keyframe shares with the frame
  double min_share_of_score = 0.75;
  int max_keyframes = 5;
  int min_inliers = 50;  // of a frame that is believed to lie there, as ORB-SLAM2 asks

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_share_of_words", min_share_of_words, Range(0, 1), "of the most words in common");
    v("min_share_of_score", min_share_of_score, Range(0, 1), "of the best score");
    v("max_keyframes", max_keyframes, Range(1, 1000), "keyframes");
    v("min_inliers", min_inliers, Range(0, 100000));
  }
};

// Where in its map a lost camera may be: the keyframes that look most like its frame, by bag of words. It is what
// ORB-SLAM2 does after a loss (R. Mur-Artal and J. Tardos, T-RO 2017; thresholds as in T-RO 2015, section V.E), and
// what the paper compares with; used with FrontendOptions::relocalise_only.
class Relocaliser {
 public:
  // vocabulary may be null: then nothing is found. It must outlive the relocaliser.
  Relocaliser(const RelocaliserOptions& options, const Vocabulary* vocabulary)
      : options_(options), vocabulary_(vocabulary) {}

  // The likeliest first (ties: newer first). Words of keyframes are found once.
  std::vector<KeyframeIndex> Candidates(const WorkingMap& map, const Frame& frame);
  // Another map: forgets the keyframes.
  void Clear() { keyframes_.clear(); }

 private:
  RelocaliserOptions options_;
  const Vocabulary* vocabulary_;
  std::vector<BowVector> keyframes_;  // by index in the map
};

}  // namespace mapmend

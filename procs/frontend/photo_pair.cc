#include "procs/frontend/photo_pair.h"

#include <algorithm>
#include <cmath>

#include "libs/base/median.h"

namespace mapmend {

PhotoPair PairOf(const FramePtr& first, const FramePtr& second, const PhotoPairOptions& options, const Pinhole& camera,
                 const Pyramid& pyramid) {
  PhotoPair pair;
  pair.first = first;
  pair.second = second;
  pair.found = MatchBruteForce(first->features, second->features, {});
  if (static_cast<int>(pair.found.size()) < options.min_points) return pair;
  const MatchedPixels pixels = PixelsOf(pair.found, first->features, second->features, camera, pyramid);
  pair.motions = RankMotions(options.ranking, camera, pixels, options.max_sigma, options.seed);
  std::erase_if(pair.motions, [&](const TwoViewCandidate& motion) {
    return static_cast<int>(motion.matches.size()) < options.min_points ||
           motion.median_angle_deg < options.min_median_angle_deg;
  });
  return pair;
}

Depths DepthsInFirst(const PhotoPair& pair, const TwoViewCandidate& motion) {
  Depths depths(pair.first->features.Size(), 0);
  for (size_t i = 0; i < motion.matches.size(); ++i) depths[pair.found[motion.matches[i]].a] = motion.points[i].z();
  return depths;
}

Depths DepthsInSecond(const PhotoPair& pair, const TwoViewCandidate& motion) {
  Depths depths(pair.second->features.Size(), 0);
  for (size_t i = 0; i < motion.matches.size(); ++i)
    depths[pair.found[motion.matches[i]].b] = (motion.second_from_first * motion.points[i]).z();
  return depths;
}

DepthAgreement Compare(const Depths& depths, const Depths& others, double max_spread) {
  std::vector<double> scales;
  for (size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] > 0 && others[i] > 0) scales.push_back(depths[i] / others[i]);
  }
  DepthAgreement agreement;
  agreement.scale = Median(scales);
  agreement.num_common = static_cast<int>(scales.size());
  agreement.num_agreeing = static_cast<int>(std::count_if(scales.begin(), scales.end(), [&](double s) {
    return std::abs(s - agreement.scale) <= max_spread * agreement.scale;
  }));
  return agreement;
}

void MotionVote::Add(const TwoViewCandidate& motion, const DepthAgreement& agreement) {
  if (agreement.num_agreeing < options_.min_agreeing * agreement.num_common) return;
  if (agreement.num_agreeing <= agreement_.num_agreeing) {
    num_rival_ = std::max(num_rival_, agreement.num_agreeing);
    return;
  }
  num_rival_ = agreement_.num_agreeing;
  winner_ = &motion;
  agreement_ = agreement;
}

}  // namespace mapmend

#include "procs/frontend/photo_pair.h"

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

std::vector<double> DepthsInFirst(const PhotoPair& pair, const TwoViewCandidate& motion) {
  std::vector<double> depths(pair.first->features.Size(), 0);
  for (size_t i = 0; i < motion.matches.size(); ++i) depths[pair.found[motion.matches[i]].a] = motion.points[i].z();
  return depths;
}

std::vector<double> DepthsInSecond(const PhotoPair& pair, const TwoViewCandidate& motion) {
  std::vector<double> depths(pair.second->features.Size(), 0);
  for (size_t i = 0; i < motion.matches.size(); ++i)
    depths[pair.found[motion.matches[i]].b] = (motion.second_from_first * motion.points[i]).z();
  return depths;
}

DepthAgreement Compare(const std::vector<double>& depths, const std::vector<double>& others, double max_spread) {
  DepthAgreement agreement;
  std::vector<double> scales;
  for (size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] > 0 && others[i] > 0) scales.push_back(depths[i] / others[i]);
  }
  agreement.scale = Median(scales);
  agreement.num_common = static_cast<int>(scales.size());
  for (const double s : scales) agreement.num_agreeing += std::abs(s - agreement.scale) <= max_spread * agreement.scale;
  return agreement;
}

}  // namespace mapmend

#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libs/geometry/rigid3.h"

namespace mapmend {

enum class TwoViewModel { kHomography, kEssential };

struct TwoViewHypothesis {
  TwoViewModel model = TwoViewModel::kHomography;
  Rigid3 second_from_first;  // |translation| = 1
};

// Candidate motions of a calibrated camera between two images, from matched image points (normalised: K^-1 pixel).
// A homography (planar or far scenes; decomposed by Malis and Vargas 2007: up to 4 motions) and an essential matrix
// (5-point, Nister 2004: 4 motions) are both estimated with RANSAC; the caller judges the candidates by triangulation.
//   threshold  pixels / focal length
//   seed       order in which RANSAC sees the matches
// Empty with fewer than 8 matches.
std::vector<TwoViewHypothesis> ProposeTwoViewMotions(const std::vector<Eigen::Vector2d>& first,
                                                     const std::vector<Eigen::Vector2d>& second, double threshold,
                                                     uint64_t seed);

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/wide_adjustment.h"
#include "libs/connecting/wide_tracks.h"

namespace mapmend {

// A track of side a and one of side b that look alike.
struct WideTrackMatch {
  int track_a = -1, track_b = -1;
  int num_votes = 0;         // pairs of frames that say so
  int squared_distance = 0;  // the least
};

struct WideRegistrationOptions {
  WideMatchingOptions matching;
  int max_matched_frames =
      4;  // of each side, evenly chosen; every pair of them is matched: 25 ms for 2500 features each
  uint64_t seed = 1;
  int num_samples = 500;      // minimal samples: three points and a frame of the other side that sees them
  double max_scale = 16;      // of b_from_a, either way: beyond it nothing was matched
  int num_refined = 6;        // best hypotheses that are refined
  double least_evidence = 2;  // nats that a match must bring, beyond what chance brings, to count at all
  double same_position =
      0.15;  // two hypotheses are the same if a camera's place differs by less, of the viewing distance, ...
  double same_turn_deg = 5;  // ... its attitude by less ...
  double same_scale = 0.2;   // ... and its scale by less (logarithm)
  // Guided search for the points of either side in the other's frames, with the transform found.
  double guided_radius = 10;        // pixels, beyond the point's own uncertainty
  double guided_ratio = 0.9;        // of descriptor distances, among features in the radius
  int guided_max_distance = 30000;  // squared, as WideSquaredDistance: chance neighbours lie beyond
  WideAdjustmentOptions adjustment;

  // Not visited: seed: that of the whole program.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("matching", matching);
    v("max_matched_frames", max_matched_frames, Range(1, 1000), "frames");
    v("num_samples", num_samples, Range(1, 1e6));
    v("max_scale", max_scale, MoreThan(1));
    v("num_refined", num_refined, Range(1, 1000));
    v("least_evidence", least_evidence, AtLeast(0), "nats");
    v("same_position", same_position, AtLeast(0), "of the viewing distance");
    v("same_turn_deg", same_turn_deg, AtLeast(0), "degrees");
    v("same_scale", same_scale, AtLeast(0));
    v("guided_radius", guided_radius, AtLeast(0), "pixels");
    v("guided_ratio", guided_ratio, Range(0, 1));
    v("guided_max_distance", guided_max_distance, Range(0, 1e9));
    v("adjustment", adjustment);
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

struct WideRegistration {
  bool success =
      false;  // a hypothesis was found and determines the transform; whether to believe it is another question
  Similarity3 b_from_a;
  Matrix7d information = Matrix7d::Zero();
  std::vector<WideTrackMatch> matches;  // those that look alike, then those found by guided search
  std::vector<char> is_inlier;          // per match
  std::vector<Eigen::Vector4d> points;  // per match, homogeneous, frame of a
  int num_alike = 0;                    // matches by descriptors alone
  int num_solid = 0;                    // inliers with a point on one side at least
  double evidence = 0;                  // nats, of the matches by descriptors alone
  double rival_evidence = 0;            // of matches that it does not explain, for the best other hypothesis
  double median_error_px = 0;
  // Guided search, both ways together: points that should be seen, and those that were found.
  int num_expected = 0, num_found = 0;
};

// Tracks that look alike: frames matched by descriptors, votes pooled over all pairs of frames; each track in one match
// at most. Most votes first.
std::vector<WideTrackMatch> MatchWideSides(const WideSide& a, const WideSide& b,
                                           const WideRegistrationOptions& options);

// What speaks for a transform, in nats: by how much better it predicts where matches are seen than chance does, over
// all those that it explains. A point with a small uncertainty says more than one with a large one.
double WideEvidence(const WideSide& a, const WideSide& b, const std::vector<WideTrackMatch>& matches,
                    const Similarity3& b_from_a, double least_evidence);

// The similarity between two sides. Hypotheses by P3P (points of one side, pixels of a frame of the other; the scale
// from depths on both sides) are ranked by WideEvidence, refined by AdjustWide on both sides' sightings, and the best
// one gets more matches by guided search. Deterministic for equal input and seed.
WideRegistration RegisterWideSides(const WideSide& a, const WideSide& b, const WideRegistrationOptions& options);

}  // namespace mapmend

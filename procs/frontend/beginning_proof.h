#pragma once

#include <optional>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/initialization.h"

namespace mapmend {

struct BeginningProofOptions {
  // RelativeShapeSigma up to which a beginning is believed at once. Photos of a survey have 0.005 to 0.03, hand-held
  // video 0.06 to 0.2 under the same angles between rays.
  double certain_sigma = 0.03;
  // ... if the median angle between its rays is at least this. Under smaller ones the second motion that explains flat
  // ground may fit better than the true one, and its covariance knows nothing of the other.
  double certain_angle_deg = 2.25;
  // Others have to be foretold, within this share of the baseline, by earlier ones with less parallax: by one that had
  // clearly less, and by more of them than foretold something else.
  double max_disagreement = 0.15;
  double min_growth = 2;  // of the baseline in units of the depth, from the one to the other
  // When so many frames have passed since the first that fitted, the next is taken, proved or not, if its sigma is not
  // larger than this, and called uncertain: more parallax may put it right, while frames that wait are no map.
  int start_patience = 30;
  double max_sigma = 0.15;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("certain_sigma", certain_sigma, AtLeast(0), "of the baseline");
    v("certain_angle_deg", certain_angle_deg, Range(0, 90), "degrees");
    v("max_disagreement", max_disagreement, AtLeast(0), "of the baseline");
    v("min_growth", min_growth, AtLeast(1), "times the baseline");
    v("start_patience", start_patience, Range(0, 1e6), "frames");
    v("max_sigma", max_sigma, AtLeast(0), "of the baseline");
  }
};

// Whether a beginning that fits is believed. Reprojection errors alone do not tell: with little parallax a wrong motion
// fits as well, if a rolling shutter or a calibration that is a little off make up for what it lacks, and it claims
// more certainty than the true one. But it does not foretell what is found, by itself, when the parallax has grown.
class BeginningProof {
 public:
  BeginningProof(const BeginningProofOptions& options, const Pinhole& camera, const Pyramid& pyramid)
      : options_(options), camera_(camera), pyramid_(pyramid) {}

  void CountFrame() { patience_ += patience_ >= 0; }
  void Clear();
  // Weighs a beginning that fits, but need not be certain. True: believe it; is_uncertain tells whether only because
  // patience is at its end.
  bool Weigh(Initialization* beginning);

  // How far off the second view of the earlier beginning is from where the later one sees it, as a share of its
  // distance from the first view, which both must have in common; infinite if too few points are common. Both are
  // scaled to the same depths.
  double Disagreement(const Initialization& earlier, const Initialization& later) const;

 private:
  struct Votes {
    int in_favour = 0, against = 0;
    bool proves = false;  // one in favour saw so much less parallax that it says something
  };
  Votes Ask(const Initialization& beginning) const;

  BeginningProofOptions options_;
  Pinhole camera_;
  Pyramid pyramid_;
  std::vector<Initialization> earlier_;  // that fitted, oldest first
  int patience_ = -1;                    // frames since the first of them; -1: none so far
};

}  // namespace mapmend

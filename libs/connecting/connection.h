#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/connecting/connected_frames.h"

namespace mapmend {

// An edge of the connection graph with all its evidence: what is known about a pair of submaps that was evaluated.
struct Connection {
  enum class Verdict { kAccepted, kRejected, kDeactivated };

  SubmapKey a, b;  // a is the older submap
  Verdict verdict = Verdict::kRejected;
  std::string reason;                     // one sentence for a person
  int num_candidates = 0;                 // pairs of keyframes that retrieval proposed and geometry looked at
  std::vector<ConnectedFrames> evidence;  // verified connected frames, in the order they were found
  ConnectedFrames best_failure;           // with most inliers, for the reason of a rejection

  // Estimated from all evidence that agrees.
  int num_connected_frames = 0;  // F
  int num_common_points = 0;     // M
  double median_angle_deg = 0;   // theta
  double strength = 0;           // C
  Similarity3 b_from_a;
  Matrix7d information = Matrix7d::Zero();
  int num_inliers = 0;
  double median_error_px = 0;
  std::vector<char> agrees;             // per evidence
  std::vector<Eigen::Vector3d> probes;  // some common points, frame of a, spread over the evidence
  double viewing_distance = 1;          // units of a
  bool in_tree = false;
};

struct ConnectionOptions {
  // Two pairs of connected frames agree if one's transform puts the other's points within this many pixels (median) of
  // where they are seen: wide enough for the drift within a submap, far too narrow for another place.
  double max_disagreement_px = 40;
  double min_strength = 2;           // C_min; weaker edges are rejected
  double drift_squared_error = 900;  // sigma^2; within it all evidence takes part in the joint estimate
  Sim3RefinementOptions refinement;
};

// Estimates Sim(3), F, M, theta and C of an edge from all its evidence as the submaps stand now, and sets verdict and
// reason. Evidence that disagrees with the majority (by inliers) is set aside: the same two submaps cannot lie in two
// ways.
void EstimateConnection(const SubmapView& a, const SubmapView& b, const ConnectionOptions& options,
                        Connection* connection);

}  // namespace mapmend

#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connected_frames.h"
#include "libs/stream/revision.h"

namespace mapmend {

// An edge of the connection graph with all its evidence: what is known about a pair of submaps that was evaluated. Of
// what is announced of it, `pairs` is left empty; Announced fills it in.
struct Connection : EvaluatedConnection {
  std::vector<ConnectedFrames> evidence;  // verified connected frames, in the order they were found
  ConnectedFrames best_failure;           // with most inliers, for the reason of a rejection

  // Estimated from all evidence that agrees, as are F, M, theta, C and b_from_a.
  Matrix7d information = Matrix7d::Zero();
  std::vector<char> agrees;                    // per evidence
  std::vector<Eigen::Vector3d> probes;         // some common points, frame of a, spread over the evidence
  double viewing_distance = 1;                 // units of a
  ConnectionKind kind = ConnectionKind::kOrb;  // `reason` begins with its ReasonPrefix
};

// What is announced of a connection: without the evidence, but with the pairs of keyframes that agree.
EvaluatedConnection Announced(const Connection& connection);

struct ConnectionOptions {
  // Two pairs of connected frames agree if one's transform puts the other's points within this many pixels (median) of
  // where they are seen: wide enough for the drift within a submap, far too narrow for another place.
  double max_disagreement_px = 40;
  double min_strength = 2;           // C_min; weaker edges are rejected
  double drift_squared_error = 900;  // sigma^2; within it all evidence takes part in the joint estimate
  // Of the extent of a submap: an edge that leaves its far end open by more, one standard deviation, is told as weak.
  double max_far_end = 0.02;
  Sim3RefinementOptions refinement;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_disagreement_px", max_disagreement_px, MoreThan(0), "pixels");
    v("min_strength", min_strength, AtLeast(0));
    v("drift_squared_error", drift_squared_error, MoreThan(0), "sigma^2");
    v("max_far_end", max_far_end, MoreThan(0), "of a submap's extent");
    v("refinement", refinement);
  }
};

// Estimates Sim(3), F, M, theta and C of an edge from all its evidence as the submaps stand now, and sets verdict and
// reason. Evidence that disagrees with the majority (by inliers) is set aside: the same two submaps cannot lie in two
// ways.
void EstimateConnection(const SubmapView& a, const SubmapView& b, const ConnectionOptions& options,
                        Connection* connection);

}  // namespace mapmend

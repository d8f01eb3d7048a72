#pragma once

#include <set>

#include "libs/base/range.h"
#include "libs/connecting/connection_graph.h"

namespace mapmend {

struct MotionBridgeOptions {
  double max_gap_s = 2;  // without a tracked frame, on either side; 0: nothing is bridged
  // How exactly either side keeps its shape from the one gap to the other, for every viewing distance of the way.
  RelationSigmas shape = {0.01, 0.02, 0.02};
  // Of what both gaps and both shapes say about each other: the sum of squares, in sigma (90 % with 7 degrees of
  // freedom).
  double max_squared_disagreement = 12;
  RelationSigmas max_open = {0.05, 0.05, 0.06};  // what may stay open of where the part lies, one sigma

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_gap_s", max_gap_s, AtLeast(0), "seconds");
    v("shape", shape);
    v("max_squared_disagreement", max_squared_disagreement, MoreThan(0), "sigma^2");
    v("max_open", max_open);
  }
};

// A part of a flight that shows too little to be recognised (overexposed, dark, blurred, bare), tracked by itself
// between two stretches that are joined to each other: where it lies follows from how the camera moved. Both gaps say
// where by dead reckoning (gap_in_path.h), each with all seven degrees of freedom; they must agree with each other, and
// with how the part itself is shaped. What holds is added to the graph as connections with the submaps on both sides,
// weaker than any other. Only submaps that have ended. Returns the pairs that were joined; a pure function of the
// sessions and the graph.
std::set<SubmapPair> BridgeByMotion(const Sessions& sessions, const MotionBridgeOptions& options,
                                    ConnectionGraph* graph);

}  // namespace mapmend

#pragma once

#include <functional>

#include "libs/connecting/connection.h"
#include "libs/connecting/loop_closure.h"

// A submap that sees its own ground again: its loops are kept as a connection of the submap with itself.
namespace mapmend {

// Verifies the pair of keyframes (a, b) of the submap.
using VerifyLoop = std::function<ConnectedFrames(KeyframeId a, KeyframeId b)>;

// A loop that no other confirms asks the keyframes next to its ends, until one does; what is found is added to the
// evidence.
void SeekSupport(const SubmapView& submap, const LoopClosureOptions& options, const VerifyLoop& verify,
                 Connection* loops);

// Judges the evidence anew: verdict, reason, and F, M, theta and C of what is used. Accepted: there is drift to take
// out; rejected: nothing holds, or nothing is gained; deactivated: loops hold by themselves, but tracking or other
// loops contradict. b_from_a, from the submap to itself, is that of the strongest loop: how far tracking was off.
void EstimateLoops(const SubmapView& submap, const LoopClosureOptions& options, Connection* loops);

}  // namespace mapmend

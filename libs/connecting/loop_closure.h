#pragma once

#include <string>
#include <vector>

#include "libs/connecting/connected_frames.h"
#include "libs/optim/sim3_pose_graph.h"

// Loop closure within a submap: which of the verified pairs of keyframes that see the same ground twice are to be
// believed, and is there drift to take out? Retrieval and VerifyConnectedFrames propose; tracking and the other loops
// decide.
namespace mapmend {

struct LoopClosureOptions {
  // Loops whose points lie within this many pixels (median) already are closed: fusion of duplicates finds them as they
  // are.
  double closed_px = 8;
  // Two loops between neighbouring keyframes confirm each other if one's transform puts the other's points within so
  // many pixels.
  double agreement_px = 20;
  int max_steps = 5;  // keyframes apart by so many, in order, are neighbours
  // How far tracking may have drifted between the two ends: so much, and so much more for each viewing distance
  // travelled.
  double gap = 0.15;  // viewing distances
  double gap_per_distance = 0.10;
  double log_scale = 0.10;
  double log_scale_per_distance = 0.05;
  double turn_deg = 10;
  double turn_deg_per_distance = 2;
  double max_turn_deg = 45;
  // What may be left open, pixels (median), of any place once all loops and all tracking are brought to agree.
  double max_left_px = 16;
  PoseGraphOptions pose_graph;

  std::string Check() const;
};

enum class LoopVerdict {
  kUsed,
  kAlone,         // no loop between neighbouring keyframes says the same
  kImplausible,   // tracking cannot have drifted so far
  kContradicted,  // cannot be closed together with stronger loops and the tracking between
};

struct LoopJudgement {
  bool is_needed = false;             // some loop is open, so that the pose graph has something to gain
  std::string reason;                 // one sentence with numbers, for a person
  std::vector<LoopVerdict> verdicts;  // per loop
  std::vector<std::string> reasons;   // per loop; empty if used
  int num_places = 0;                 // groups of neighbouring loops that are used
  double gap_px = 0;                  // largest gap of a loop that is used and of another one, as tracked
  double left_px = 0;                 // and once all are closed
};

// Whether one's transform puts the other's points where they are seen, both ways.
bool LoopsAgree(const SubmapView& view, const ConnectedFrames& first, const ConnectedFrames& second,
                const LoopClosureOptions& options);

// Loops (indices, ascending) that agree with no other between neighbours of their keyframes.
std::vector<int> FindLoneLoops(const SubmapView& view, const std::vector<ConnectedFrames>& loops,
                               const LoopClosureOptions& options);

// Judges all loops of one submap together. A pure function; loops whose keyframes have been culled are contradicted.
LoopJudgement JudgeLoops(const SubmapView& view, const std::vector<ConnectedFrames>& loops,
                         const LoopClosureOptions& options);

}  // namespace mapmend

#pragma once

#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/connected_frames.h"
#include "libs/connecting/pose_graph_relations.h"
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
  KeyframeRelationOptions relations;
  PoseGraphOptions pose_graph;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("closed_px", closed_px, MoreThan(0), "pixels");
    v("agreement_px", agreement_px, MoreThan(0), "pixels");
    v("max_steps", max_steps, Range(1, 10000), "keyframes");
    v("gap", gap, AtLeast(0), "viewing distances");
    v("gap_per_distance", gap_per_distance, AtLeast(0), "of the way");
    v("log_scale", log_scale, AtLeast(0));
    v("log_scale_per_distance", log_scale_per_distance, AtLeast(0), "per viewing distance");
    v("turn_deg", turn_deg, AtLeast(0), "degrees");
    v("turn_deg_per_distance", turn_deg_per_distance, AtLeast(0), "degrees per viewing distance");
    v("max_turn_deg", max_turn_deg, Range(0, 180), "degrees");
    v("max_left_px", max_left_px, MoreThan(0), "pixels");
    v("relations", relations);
    v("pose_graph", pose_graph);
  }
  // Empty, or one line that names the first option that is wrong.
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

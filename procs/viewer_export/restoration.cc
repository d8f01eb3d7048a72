#include "procs/viewer_export/restoration.h"

#include <algorithm>

namespace mapmend {
namespace {

RestorableSubmap Describe(const SnapshotSubmap& submap) {
  RestorableSubmap restorable;
  restorable.key = submap.key;
  restorable.begin_utime = submap.frames.front().utime;
  restorable.begin_frame = submap.frames.front().frame;
  restorable.ended = submap.submap->ended;
  restorable.end_utime = submap.frames.back().utime;
  return restorable;
}

int FrameAt(const SnapshotSubmap& submap, int64_t utime) {
  const auto at = std::lower_bound(submap.frames.begin(), submap.frames.end(), utime,
                                   [](const MergedFrame& frame, int64_t t) { return frame.utime < t; });
  return at != submap.frames.end() && at->utime == utime ? at->frame : -1;
}

// Connected from the first keyframe of the younger submap on that sees the older one's ground; a map of which only the
// connections are known, not their frames, tells no more than the submap.
RestorableConnection Describe(const Snapshot& snapshot, const EvaluatedConnection& connection, int older, int younger) {
  const SnapshotSubmap& submap = snapshot.submaps[younger];
  RestorableConnection joint{older, younger, submap.frames.back().utime, -1};
  for (const EvaluatedConnection::FramePair& pair : connection.pairs) {
    const auto utime = snapshot.model->FindKeyframeUtime(submap.key.session, pair.b);
    if (utime) joint.utime = std::min(joint.utime, *utime);
  }
  joint.frame = FrameAt(submap, joint.utime);
  return joint;
}

}  // namespace

RestorationTable MakeRestorationTable(const Snapshot& snapshot) {
  std::vector<RestorableSubmap> submaps;
  std::vector<int> in_snapshot, in_list(snapshot.submaps.size(), -1);  // a submap without frames has no place in it
  for (size_t i = 0; i < snapshot.submaps.size(); ++i) {
    if (snapshot.submaps[i].frames.empty()) continue;
    in_list[i] = static_cast<int>(submaps.size());
    in_snapshot.push_back(static_cast<int>(i));
    submaps.push_back(Describe(snapshot.submaps[i]));
  }
  RestorationTable table;
  std::vector<RestorableConnection> connections;
  for (const EvaluatedConnection& connection : snapshot.model->Revision().connections) {
    const int a = snapshot.FindSubmap(connection.a), b = snapshot.FindSubmap(connection.b);
    const bool joins = a >= 0 && b >= 0 && a != b && in_list[a] >= 0 && in_list[b] >= 0;
    if (!joins || connection.verdict != EvaluatedConnection::Verdict::kAccepted) continue;
    RestorableConnection joint = Describe(snapshot, connection, a, b);
    joint.older = in_list[a];
    joint.younger = in_list[b];
    connections.push_back(joint);
    table.connections.push_back(&connection);
  }
  table.steps = Restore(submaps, connections);
  const auto rename = [&](int* submap) { *submap = *submap < 0 ? -1 : in_snapshot[*submap]; };
  for (RestorationStep& step : table.steps) {
    rename(&step.submap);
    rename(&step.lost);
    for (auto* stack : {&step.unrecovered, &step.tracked}) {
      for (std::vector<int>& map : *stack) std::for_each(map.begin(), map.end(), [&](int& s) { rename(&s); });
    }
  }
  return table;
}

std::string DescribeStacks(const Snapshot& snapshot) {
  const std::vector<RestorationStep> steps = MakeRestorationTable(snapshot).steps;
  if (steps.empty()) return "";
  const auto stack = [](const std::vector<std::vector<int>>& maps) {
    return maps.empty() ? std::string("–") : StackLetters(maps);
  };
  return "L1 " + stack(steps.back().unrecovered) + "; L2 " + stack(steps.back().tracked);
}

}  // namespace mapmend

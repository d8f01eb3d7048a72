#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "libs/base/range.h"
#include "libs/connecting/connection_graph.h"
#include "libs/connecting/merged_transforms.h"
#include "libs/merging/refinement_task.h"

namespace mapmend {

struct RefinementScheduleOptions {
  RefinementScheduleOptions();

  MergedRefinementOptions final_map;
  MergedRefinementOptions live;  // during the flight: fewer rounds, and a part of the points
  double live_growth = 1.5;      // due when so many times the keyframes are joined, or the tree is another one

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("final_map", final_map);
    v("live", live);
    v("live_growth", live_growth, MoreThan(1));
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
};

// Says when the merged map is refined during the flight, makes the task, and keeps what came of it: where the submaps
// lie relative to each other. The final refinement changes nothing here but the shutters.
class RefinementSchedule {
 public:
  explicit RefinementSchedule(const RefinementScheduleOptions& options) : options_(options) {}

  // The tree of a joined map has changed since the last task was made, or the map has grown.
  bool IsDue(const Sessions& sessions, const ConnectionGraph& graph) const;
  // The refinement of the map as the graph and `transforms` (as PlaceSubmaps gives them) put it.
  //   is_complete       the final one: all evidence is there
  //   copy_features     submaps that grow are copied with their features: they cannot be read elsewhere
  RefinementTask Begin(const Sessions& sessions, const ConnectionGraph& graph, MergedTransforms transforms,
                       bool is_complete, bool copy_features);
  // Takes in the outcome of the live task that was begun last. False if a connection that took part does not hold any
  // more.
  bool Take(const RefinementOutcome& outcome, const ConnectionGraph& graph);
  void TakeFinal(const RefinementOutcome& outcome) { shutters_ = outcome.shutters; }
  // What was refined with a connection that has turned out wrong is bent by it, and forgotten.
  void OnGraphChange(const ConnectionGraph& graph);
  void Forget() { taken_ = {}; }

  // Where the last refinement taken in put each submap.
  const std::map<SubmapKey, RefinedPlace>& places() const { return taken_.places; }
  // Rolling ones that the final refinement found, per session.
  const std::map<std::string, Shutter>& shutters() const { return shutters_; }

 private:
  // What a refinement during the flight was made of, and where it put the submaps.
  struct Live {
    std::map<SubmapKey, RefinedPlace> places;
    std::set<SubmapPair> pairs;  // connections that took part
    std::set<SubmapPair> tree;
    int num_keyframes = 0;  // of submaps that were joined to others
  };

  RefinementScheduleOptions options_;
  Live taken_, begun_;
  std::map<std::string, Shutter> shutters_;
};

// Where the tree puts every submap, by age; submaps of one component that were refined together keep their places
// relative to each other. Components are numbered by the frames they hold, most first.
//   refined  of some submaps
MergedTransforms PlaceSubmaps(const Sessions& sessions, const ConnectionGraph& graph,
                              const std::map<SubmapKey, RefinedPlace>& refined);

}  // namespace mapmend

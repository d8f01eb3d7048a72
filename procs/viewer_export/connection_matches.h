#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

// What two keyframes have in common, to be shown to a person. The merger does not keep it: it is worked out again, from
// the stored features, and always the same.
struct ConnectionMatches {
  KeyframeId a, b;
  using Pixels = std::pair<Eigen::Vector2f, Eigen::Vector2f>;  // of the ideal cameras
  std::vector<Pixels> matches;
  // They fit the transform between the submaps; else descriptors are alike, no more.
  bool are_inliers = false;
};

// Of an accepted connection: its pair of connected frames with most inliers, and the map points of each that are found
// in the other where the map has them. Of a rejected one: of the pairs of keyframes that look most alike, the one with
// most matches of descriptors. nullopt if the keyframes cannot be read, or none look alike.
std::optional<ConnectionMatches> MatchConnection(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                                 const FetchKeyframe& fetch);

}  // namespace mapmend

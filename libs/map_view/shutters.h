#pragma once

#include <map>
#include <string>
#include <vector>

#include "libs/map_view/snapshot.h"

namespace mapmend {

// How a camera reads its images, and how it moved: what is needed to say where it was when it read a line.
struct FoundShutter {
  double readout = 0;       // seconds, from the first line to the last; 0: all at once
  bool by_columns = false;  // lines are columns, of a camera that was turned
};

// The readout times of the sessions of a map that was refined with them, by session, found again from what is left of
// the features: they were taken out of the map, not out of the images. A session whose features tell none has none.
std::map<std::string, FoundShutter> FindShutters(const Snapshot& snapshot);

// What a camera moves by while it reads an image.
struct ReadoutMove {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // units of the snapshot, frame of the camera
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();   // radians, frame of the camera
};
// As the keyframes of a component; none of sessions without a readout time.
std::vector<ReadoutMove> ReadoutMoves(const Snapshot& snapshot, int component,
                                      const std::map<std::string, FoundShutter>& shutters);

}  // namespace mapmend

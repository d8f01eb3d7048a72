#pragma once

#include <string>
#include <utility>
#include <vector>

#include "libs/geometry/similarity3.h"
#include "libs/stream/ids.h"
#include "libs/stream/stream_cursor.h"

// What a revision of the merged map consists of.
namespace mapmend {

// Where every submap stands.
struct MergedTransforms {
  int64_t revision = 0;  // grows: 2 * (records consumed + decisions of people), + 1 if refined
  std::vector<StreamCursor> cursors;
  bool refined = false, is_final = false;
  struct Place {
    SubmapKey key;
    int component = 0;  // 0: the one with most frames
    Similarity3 root_from_submap;
    bool is_root = false;
  };
  std::vector<Place> submaps;              // oldest first
  std::vector<std::pair<int, int>> edges;  // of the tree: indices into submaps
};

// One submap of a refined map.
struct RefinedSubmap {
  SubmapKey key;
  struct Keyframe {
    KeyframeId id;
    Rigid3 cam_from_root;
    double scale = 1;
  };
  struct Point {
    MapPointId id;
    Eigen::Vector3f position;
  };
  struct Fused {
    MapPointId id;
    SubmapKey into_submap;
    MapPointId into;
  };
  std::vector<Keyframe> keyframes;
  std::vector<Point> points;
  std::vector<Fused> fused;
};

}  // namespace mapmend

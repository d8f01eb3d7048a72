#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libs/geometry/similarity3.h"
#include "libs/stream/ids.h"

// What the merger has made of the submaps, as plain C++ (revision_codec.h reads it from the bus).
namespace mapmend {

// One evaluated pair of submaps: an edge of the connection graph, or the reason why there is none.
struct EvaluatedConnection {
  enum class Verdict { kAccepted, kRejected, kDeactivated };

  SubmapKey a, b;
  Verdict verdict = Verdict::kRejected;
  std::string reason;            // one sentence for a person
  int num_connected_frames = 0;  // F
  int num_common_points = 0;     // M
  double median_angle_deg = 0;   // theta
  double strength = 0;           // C = F + 0.1 M + 0.1 theta^2 (paper eq. 3)
  int num_candidates = 0;        // pairs of keyframes that retrieval proposed
  int num_inliers = 0;
  double reprojection_error = 0;  // median, pixels
  Similarity3 b_from_a;
  bool in_tree = false;
};

struct MergedSubmap {
  SubmapKey key;
  int component = 0;
  Similarity3 root_from_submap;
  bool is_root = false;
};

struct RefinedKeyframe {
  Rigid3 cam_from_root;
  double scale = 1;  // length of one submap unit near this keyframe, in root units
};

// Keyframes and points of one submap after refinement, in the frame of its component's root.
struct RefinedSubmap {
  std::map<KeyframeId, RefinedKeyframe> keyframes;
  std::map<MapPointId, Eigen::Vector3d> points;
  std::map<MapPointId, std::pair<std::string, MapPointId>>
      fused;  // the same as a point (session, id) of an older submap
};

struct MapRevision {
  int64_t revision = -1;  // -1: none yet
  bool refined = false;
  bool final = false;                      // every session has ended and refinement is done
  std::map<std::string, int64_t> cursors;  // session: last record it was made from
  std::vector<MergedSubmap> submaps;
  std::vector<std::pair<SubmapKey, SubmapKey>> tree;
  std::vector<EvaluatedConnection> connections;
  std::map<SubmapKey, RefinedSubmap> refinement;
};

}  // namespace mapmend

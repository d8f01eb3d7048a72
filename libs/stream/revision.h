#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libs/geometry/same_bits.h"
#include "libs/stream/ids.h"
#include "libs/stream/stream_cursor.h"

// What the merger makes of the submaps, as merger, store, viewer and launcher know it (libs/wire/revision_codec.h has
// the wire form). A revision of the merged map is where every submap stands, what was found out about every pair of
// them, and, once it is refined, where their keyframes and points are.
namespace mapmend {

// One evaluated pair of submaps: an edge of the connection graph, or the reason why there is none. Of a submap with
// itself (a == b): the loops within it.
struct EvaluatedConnection {
  enum class Verdict { kAccepted = 0, kRejected = 1, kDeactivated = 2 };  // the numbers on the wire and in files
  struct FramePair {                                                      // connected frames that the estimate rests on
    KeyframeId a, b;
    int num_inliers = 0;
    bool operator==(const FramePair&) const = default;
  };

  SubmapKey a, b;  // from the merger, a is the older submap
  Verdict verdict = Verdict::kRejected;
  std::string reason;            // one sentence for a person
  int num_connected_frames = 0;  // F
  int num_common_points = 0;     // M
  double median_angle_deg = 0;   // theta, clamped at 45
  double strength = 0;           // C = F + 0.1 M + 0.1 theta^2 (paper eq. 3)
  int num_candidates = 0;        // pairs of keyframes that retrieval proposed and geometry looked at
  int num_inliers = 0;           // of the Sim(3)
  double median_error_px = 0;    // of the inliers' reprojections
  Similarity3 b_from_a;          // identity if none was found
  bool in_tree = false;
  std::vector<FramePair> pairs;

  bool operator==(const EvaluatedConnection&) const = default;
};

// How a connection was found: by map points that look alike, by wide features, or by how the camera moved before and
// behind a part that shows too little.
enum class ConnectionKind { kOrb, kWide, kMotion };
// Begins the reason of a connection of this kind; the wire form and old files have no other place for it.
const char* ReasonPrefix(ConnectionKind kind);
ConnectionKind KindOf(const EvaluatedConnection& connection);
// "orb", "wide", "motion".
const char* ToString(ConnectionKind kind);
// Likewise stands in the reason of a connection that is used although its own uncertainty moves the far end of a submap
// visibly.
inline constexpr char kWeakReason[] = "; weak: ";
bool IsWeak(const EvaluatedConnection& connection);
// "accepted", "rejected", "deactivated".
const char* ToString(EvaluatedConnection::Verdict verdict);

// Where every submap stands.
struct MergedTransforms {
  struct Place {
    SubmapKey key;
    int component = 0;  // 0: the one with most frames
    Similarity3 root_from_submap;
    bool is_root = false;
    bool operator==(const Place&) const = default;
  };

  int64_t revision = 0;               // grows: 2 * (records consumed + decisions of people), + 1 if refined
  std::vector<StreamCursor> cursors;  // the records it was made from
  bool refined = false;               // false: composed along the tree; true: after pose graph and bundle adjustment
  bool is_final = false;              // every session has ended and refinement is done
  std::vector<Place> submaps;         // oldest first
  std::vector<std::pair<int, int>> edges;  // of the tree: indices into submaps

  bool operator==(const MergedTransforms&) const = default;
};

// Keyframes and points of one submap after refinement, in the frame of its component's root. In no order.
struct RefinedSubmap {
  struct Keyframe {
    KeyframeId id;
    Rigid3 cam_from_root;
    double scale = 1;  // length of one submap unit near this keyframe, in root units
    bool operator==(const Keyframe&) const = default;
  };
  struct Point {
    MapPointId id;
    Eigen::Vector3f position;
    bool operator==(const Point&) const = default;
  };
  struct Fused {  // the same as a point of an older submap, perhaps of another session
    MapPointId id;
    std::string into_session;
    MapPointId into;
    bool operator==(const Fused&) const = default;
  };

  SubmapKey key;
  std::vector<Keyframe> keyframes;
  std::vector<Point> points;
  std::vector<Fused> fused;

  bool operator==(const RefinedSubmap&) const = default;
};

struct MapRevision {
  MergedTransforms transforms;
  std::vector<EvaluatedConnection> connections;
  std::vector<RefinedSubmap> refined;  // empty: transforms only

  bool operator==(const MapRevision&) const = default;
};

// A person's word on a connection. The last one about a pair is in force.
struct EdgeDecision {
  SubmapKey a, b;         // in either order
  bool disabled = false;  // true: not to be used, whatever speaks for it; false: the merger decides again
  bool operator==(const EdgeDecision&) const = default;
};

}  // namespace mapmend

#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "libs/features/features.h"
#include "libs/features/wide_features.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/positioning/position_fix.h"
#include "libs/retrieval/bow_vector.h"
#include "libs/stream/ids.h"

// The records of the stream as plain C++ (lcmtypes/*.lcm are their wire form; libs/wire/codec.h converts). A session is
// the sequence SessionStarted, then SubmapStarted, KeyframeRecord, MapUpdate, SubmapEnded, WideFeaturesRecord,
// PositionsRecord in any legal order, then SessionEnded.
namespace mapmend {

struct RecordHeader {
  std::string session;
  int64_t seq = -1;
  int64_t utime = 0;
};

struct SessionStarted {
  std::string version, vehicle, source;
  Camera camera;    // the real one
  Pinhole pinhole;  // the ideal one, in whose pixels all features are given
  Pyramid pyramid;
  std::string vocabulary_hash;
  std::string settings_json;
  int num_frames = 0;  // expected; 0 if unknown
};

struct SessionEnded {
  int num_frames = 0;  // read
};

struct SubmapStarted {
  SubmapId submap;
};

// A loss event, or the end of the input.
struct SubmapEnded {
  SubmapId submap;
  std::string reason;  // see submap_t.lcm
  std::string detail;
  int last_frame = -1;
  int64_t last_utime = 0;
};

struct KeyframeRecord {
  SubmapId submap;
  KeyframeId keyframe;
  int frame = -1;
  Rigid3 cam_from_submap;
  Features features;
  std::vector<MapPointId> map_points;  // per feature
  std::vector<int32_t> words;          // per feature, -1 without
  std::vector<int32_t> nodes;          // per feature
  BowVector bow;
};

struct KeyframePose {
  KeyframeId keyframe;
  Rigid3 cam_from_submap;
};

struct PointPosition {
  MapPointId point;
  Eigen::Vector3f position;  // submap frame
};

struct ObservationChange {
  KeyframeId keyframe;
  int feature = -1;
  MapPointId point;  // invalid: the feature observes nothing any more
};

struct TrackedFrame {
  int frame = -1;
  int64_t utime = 0;
  KeyframeId keyframe;
  Rigid3 cam_from_keyframe;
};

struct MapUpdate {
  SubmapId submap;
  std::vector<KeyframePose> keyframes;
  std::vector<PointPosition> points;
  std::vector<ObservationChange> observations;
  std::vector<KeyframeId> removed_keyframes;
  std::vector<MapPointId> removed_points;
  std::vector<TrackedFrame> frames;
};

// Of a keyframe that was published before, or of a frame that was not tracked between a submap and the next. May follow
// the end of its submap.
struct WideFeaturesRecord {
  SubmapId submap;
  KeyframeId keyframe;  // none: a frame that was not tracked
  int frame = -1;
  WideFeatures features;
};

// Where a receiver says that the vehicle was, in the order in which it was told. May come at any time.
struct PositionsRecord {
  std::vector<PositionFix> fixes;
};

using RecordBody = std::variant<SessionStarted, SessionEnded, SubmapStarted, SubmapEnded, KeyframeRecord, MapUpdate,
                                WideFeaturesRecord, PositionsRecord>;

struct Record {
  RecordHeader header;
  RecordBody body;
};

// A record as it is published, stored and sent again.
struct EncodedRecord {
  std::string session;
  int64_t seq = -1;
  std::string channel;  // without prefix
  std::vector<uint8_t> data;
  bool operator==(const EncodedRecord&) const = default;
};

}  // namespace mapmend

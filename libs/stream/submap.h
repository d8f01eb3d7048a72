#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "libs/base/compact_vector.h"
#include "libs/base/sorted_map.h"
#include "libs/stream/ids.h"
#include "libs/stream/records.h"

// The read model of the stream: what every consumer downstream of the frontend knows of a flight. Built only by
// applying records in order, so equal streams give equal models. Ordered containers, so that iteration is
// deterministic.
namespace mapmend {

// How many map points a keyframe shares with another one.
struct SharingKeyframe {
  KeyframeId keyframe;  // the other
  int num_points = 0;
};

struct SubmapKeyframe {
  KeyframeId id;
  int64_t utime = 0;
  int frame = -1;
  int64_t seq = -1;
  Rigid3 cam_from_submap;
  Features features;
  std::vector<int32_t> words, nodes;
  BowVector bow;
  std::vector<MapPointId> map_points;     // per feature
  CompactVector<SharingKeyframe> shared;  // as Submap::CountShared; only known once observations are forgotten
};

struct SubmapObservation {
  KeyframeId keyframe;
  int feature = -1;
};

struct SubmapPoint {
  MapPointId id;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // submap frame; as the stream tells it
  CompactVector<SubmapObservation> observations;       // ascending by keyframe
};

// A culled keyframe, and the one that shared most map points with it when it went: what refers to the one refers to
// the other, and follows its corrections.
struct RemovedKeyframe {
  KeyframeId successor;  // may have been removed later itself
  Rigid3 cam_from_successor;
};

// Wide features of a keyframe, which may be culled since. Null: they are read again when needed.
struct SubmapWideFeatures {
  int64_t seq = -1;   // of their record
  int64_t utime = 0;  // of the image
  std::shared_ptr<const WideFeatures> features;
};

struct Submap {
  SubmapId id;
  bool ended = false;
  std::string end_reason, end_detail;
  int last_frame = -1;
  std::map<KeyframeId, SubmapKeyframe> keyframes;
  SortedMap<MapPointId, SubmapPoint> points;
  std::vector<TrackedFrame> frames;  // in the order they were tracked; they may refer to removed keyframes
  std::map<KeyframeId, RemovedKeyframe> removed_keyframes;
  std::map<KeyframeId, SubmapWideFeatures> wide;   // of some keyframes near the beginning and the end
  std::map<int, SubmapWideFeatures> wide_between;  // of frames behind it that were not tracked, by their index
  bool has_observations = true;                    // of points; false: forgotten

  // The frame relative to a keyframe that there is.
  TrackedFrame Resolved(TrackedFrame frame) const;
  Rigid3 CamFromSubmap(const TrackedFrame& frame) const;

  // Ascending by keyframe; without those that share nothing, and without itself.
  CompactVector<SharingKeyframe> CountShared(const SubmapKeyframe& keyframe) const;
  // Lets go of what a record of wide features has brought, but for what is needed to read it again.
  void ForgetWide(const WideFeaturesRecord& record);
  // Half of what map points take is who sees them, which the keyframes know as well. Of a submap that has ended, lets
  // go of it and keeps what else is asked of it, CountShared.
  void ForgetObservations();
};

struct Session {
  std::string id;
  int64_t start_utime = 0;
  int64_t last_seq = -1;
  bool ended = false;
  int num_frames = 0;  // read, known once ended
  SessionStarted info;
  std::map<SubmapId, Submap> submaps;
  std::vector<PositionFix> positions;  // in the order of the stream

  // Applies the next record. Returns an empty string, or one line that says what is wrong with it (seq not above the
  // last, unknown submap, keyframe, point or feature index, a submap that has ended, non-finite value); then the
  // session is unchanged. A seq may be left out: that record is lost, and the store's gap table says why.
  std::string Apply(const Record& record);
};

// Number of map points that two keyframes of one submap share.
int CountSharedPoints(const SubmapKeyframe& a, const SubmapKeyframe& b);

}  // namespace mapmend

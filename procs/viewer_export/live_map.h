#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "libs/map_view/map_model.h"
#include "procs/viewer_export/live_feed.h"

namespace mapmend {

// "SESSION INDEX:SUBMAP", the name of a submap on the page; sessions count in the order in which they came.
std::string PageKey(const MapModel& model, const SubmapKey& key);
// The submap of such a name; none: an invalid id.
SubmapKey ParsePageKey(const MapModel& model, const std::string& text);

// The map as rows of a feed, kept up to date record by record: the work for a record depends on the record, not on the
// map. All lengths are in the submap's own frame and unit; where a submap stands is told apart (live_values.h), so that
// a merge moves nothing here. Of a refined submap the rows are the refined map, carried back into its frame.
//
// Tables, "KIND/SUBMAP" with PageKey; t is seconds since the session began:
//   points     x, y, z, t of the keyframe that saw it first (float32), red, green, blue, shown (uint8)
//   keyframes  id, frame (int32), t, cam_from_submap: tx ty tz qx qy qz qw (float32), shown (uint32)
//   frames     frame (int32), t (float32), row of its keyframe (uint32), camera's place in that keyframe's camera
//              (3 float32)
class LiveMap {
 public:
  // After the model has taken the record.
  void OnRecord(const Record& record, const MapModel& model);
  // After the model has taken a revision with its refined parts.
  void OnRevision(const MapModel& model);
  // Writes what has changed. Returns whether anything has.
  bool Publish(const MapModel& model, LiveFeed* feed);

 private:
  struct PagePoint {
    uint32_t row = 0;
    float t = 0;
    Eigen::Vector3f position = Eigen::Vector3f::Zero();  // as published
    bool is_published = false;
    bool is_hidden = false;  // left out by the refinement, or fused into another
  };
  struct PageSubmap {
    std::map<MapPointId, PagePoint> points;
    std::map<KeyframeId, uint32_t> keyframe_rows;
    std::vector<KeyframeId> keyframe_of_row;
    size_t num_frames_published = 0;
    std::set<MapPointId> dirty_points;
    std::set<KeyframeId> dirty_keyframes;
    bool resend_frames = false;  // a keyframe that frames refer to was culled
    // What the last refinement said and no record has changed since, in the submap's frame.
    std::map<KeyframeId, Rigid3> refined_keyframes;
    std::map<MapPointId, Eigen::Vector3f> refined_points;
  };

  void OnKeyframe(const KeyframeRecord& record, float t, PageSubmap* page);
  static void OnUpdate(const MapUpdate& update, PageSubmap* page);
  static void TakeRefined(const Submap& submap, const RefinedSubmap& refined, const Similarity3& root_from_submap,
                          PageSubmap* page);
  void PublishPoints(const std::string& name, const Submap& submap, PageSubmap* page, LiveFeed* feed);
  static void PublishKeyframes(const std::string& name, const Session& session, const Submap& submap, PageSubmap* page,
                               LiveFeed* feed);
  static void PublishFrames(const std::string& name, const Session& session, const Submap& submap, PageSubmap* page,
                            LiveFeed* feed);

  std::map<SubmapKey, PageSubmap> submaps_;
  std::set<SubmapKey> dirty_;
  size_t num_points_ = 0;
};

}  // namespace mapmend

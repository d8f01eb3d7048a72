#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libs/stream/revision.h"
#include "libs/stream/submap.h"

namespace mapmend {

// All that the viewer knows: the sessions, built from their records, and the newest merged map. Knows nothing of LCM.
class MapModel {
 public:
  MapModel() { revision_.transforms.revision = -1; }

  // Applies the next record of a session. Returns an empty string, or one line that says what is wrong with it; then
  // nothing has changed. What no export needs (descriptors, words) is dropped.
  std::string Apply(const Record& record);

  // Takes over a complete revision of the merged map. An older revision than the one held is ignored (false). A
  // revision that brings no connections leaves those known.
  bool SetRevision(MapRevision map);
  // Takes over transforms that came ahead of the rest of their revision: connections stay, refined poses go. Ignored
  // (false) unless newer than what is held.
  bool SetTransforms(MergedTransforms transforms);
  // One connection as evaluated now; replaces what was known of the pair until the next revision.
  void SetConnection(const EvaluatedConnection& connection);

  // In the order in which the sessions were first seen.
  const std::vector<std::string>& SessionOrder() const { return session_order_; }
  const Session& GetSession(const std::string& id) const { return sessions_.at(id); }
  const MapRevision& Revision() const { return revision_; }
  // When a keyframe's image was taken, also of culled ones.
  int64_t KeyframeUtime(const std::string& session, KeyframeId keyframe) const;
  // The same; none of a keyframe that is not known yet.
  std::optional<int64_t> FindKeyframeUtime(const std::string& session, KeyframeId keyframe) const;
  // Of the newest record of a session: once it has ended, when its last frame was taken.
  int64_t LastUtime(const std::string& session) const { return last_utimes_.at(session); }
  bool AllEnded() const;
  // Whether the merged map is the final one, and every record it was made from is known here.
  bool IsComplete() const;
  // Grows with every change.
  int64_t Version() const { return version_; }

 private:
  std::map<std::string, Session> sessions_;
  std::vector<std::string> session_order_;
  std::map<std::string, std::map<KeyframeId, int64_t>> keyframe_utimes_;
  std::map<std::string, int64_t> last_utimes_;  // by session
  MapRevision revision_;                        // number -1: none yet
  int64_t version_ = 0;
};

}  // namespace mapmend

#include "procs/submap_store/session_progress.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "procs/submap_store/blob.h"

namespace mapmend {
namespace {

// Points that were removed after they had been published are in no table, and no new point may take their name. A
// keyframe makes a few thousand points at the most.
constexpr int64_t kRemovedPoints = 1 << 16;

int32_t AskNumber(Database* database, const std::string& sql, int64_t row) {
  auto query = database->Prepare(sql);
  query->bind(1, row);
  return query->executeStep() ? query->getColumn(0).getInt() : -1;
}

int32_t LastPoint(const Submap& submap) {
  return submap.points.empty() ? -1 : std::prev(submap.points.end())->first.value;
}

}  // namespace

SessionProgress ReadProgress(Database* database, int64_t row, const Session& model,
                             const std::deque<GeometryWriter>& waiting) {
  SessionProgress progress;
  progress.next_submap = 1 + AskNumber(database, "SELECT ifnull(max(submap), -1) FROM submap WHERE session = ?", row);
  progress.next_keyframe =
      1 + AskNumber(database, "SELECT ifnull(max(keyframe), -1) FROM keyframe WHERE session = ?", row);
  progress.last_utime = model.start_utime;
  {
    auto ended = database->Prepare(
        "SELECT ifnull(max(last_frame), -1), ifnull(max(end_utime), 0) FROM submap WHERE session = ?");
    ended->bind(1, row);
    if (ended->executeStep()) {
      progress.last_frame = ended->getColumn(0).getInt();
      progress.last_utime = std::max(progress.last_utime, ended->getColumn(1).getInt64());
    }
  }
  const auto note = [&](int frame, int64_t utime) {
    progress.last_frame = std::max(progress.last_frame, frame);
    progress.last_utime = std::max(progress.last_utime, utime);
  };
  int32_t last_point = -1;
  {
    auto chunks = database->Prepare("SELECT ids FROM map_points WHERE session = ?");
    chunks->bind(1, row);
    while (chunks->executeStep()) {
      for (const int32_t id : ReadBlob<int32_t>(chunks->getColumn(0))) last_point = std::max(last_point, id);
    }
  }
  for (const GeometryWriter& writer : waiting) {
    if (writer.session() == row) last_point = std::max(last_point, LastPoint(writer.submap()));
  }
  for (const auto& [id, submap] : model.submaps) {
    if (submap.ended) continue;
    progress.open_submap = id;
    last_point = std::max(last_point, LastPoint(submap));
    for (const auto& [keyframe_id, keyframe] : submap.keyframes) note(keyframe.frame, keyframe.utime);
    for (const TrackedFrame& frame : submap.frames) note(frame.frame, frame.utime);
  }
  if (last_point >= 0)
    progress.next_point = static_cast<int32_t>(std::min<int64_t>(last_point + kRemovedPoints, 1 << 30));
  return progress;
}

}  // namespace mapmend

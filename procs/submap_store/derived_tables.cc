#include "procs/submap_store/derived_tables.h"

#include <algorithm>

#include "procs/submap_store/blob.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

constexpr int kKeyframesPerStep = 16;
constexpr int kPointsPerChunk = 4096;

void WriteSubmapStart(Database* database, int64_t session, const RecordHeader& header, const SubmapStarted& body) {
  Database::Use insert =
      database->Prepare("INSERT OR REPLACE INTO submap(session, submap, start_seq, start_utime) VALUES(?, ?, ?, ?)");
  insert->bind(1, session);
  insert->bind(2, body.submap.value);
  insert->bind(3, header.seq);
  insert->bind(4, header.utime);
  insert->exec();
}

void WriteSubmapEnd(Database* database, int64_t session, const RecordHeader& header, const SubmapEnded& body) {
  Database::Use update = database->Prepare(
      "UPDATE submap SET end_seq = ?, end_utime = ?, end_reason = ?, end_detail = ?, last_frame = ? "
      "WHERE session = ? AND submap = ?");
  update->bind(1, header.seq);
  update->bind(2, header.utime);
  update->bind(3, body.reason);
  update->bind(4, body.detail);
  update->bind(5, body.last_frame);
  update->bind(6, session);
  update->bind(7, body.submap.value);
  update->exec();
}

void WriteKeyframeRows(Database* database, int64_t session, const RecordHeader& header, const KeyframeRecord& body) {
  Database::Use keyframe = database->Prepare(
      "INSERT OR REPLACE INTO keyframe(session, keyframe, submap, seq, utime, frame, num_features) VALUES(?, ?, ?, ?, "
      "?, ?, ?)");
  keyframe->bind(1, session);
  keyframe->bind(2, body.keyframe.value);
  keyframe->bind(3, body.submap.value);
  keyframe->bind(4, header.seq);
  keyframe->bind(5, header.utime);
  keyframe->bind(6, body.frame);
  keyframe->bind(7, body.features.Size());
  keyframe->exec();
  Database::Use bow =
      database->Prepare("INSERT OR REPLACE INTO keyframe_bow(session, keyframe, words, weights) VALUES(?, ?, ?, ?)");
  bow->bind(1, session);
  bow->bind(2, body.keyframe.value);
  const std::vector<uint8_t> words = PackAscending(body.bow.words);
  BindBlob(bow.get(), 3, words);
  BindBlob(bow.get(), 4, body.bow.weights);
  bow->exec();
}

void WriteRemovedKeyframes(Database* database, int64_t session, const RecordHeader& header, const MapUpdate& body) {
  for (const KeyframeId id : body.removed_keyframes) {
    Database::Use update = database->Prepare(
        "UPDATE keyframe SET removed_seq = ? WHERE session = ? AND keyframe = ? AND removed_seq IS NULL");
    update->bind(1, header.seq);
    update->bind(2, session);
    update->bind(3, id.value);
    update->exec();
  }
}

// As lcm does not pack it: frame int32, keyframe int32, utime int64, pose 7 doubles.
struct FrameRow {
  int32_t frame, keyframe;
  int64_t utime;
  double cam_from_keyframe[7];
};
static_assert(sizeof(FrameRow) == 72);

}  // namespace

int64_t InsertSession(Database* database, const RecordHeader& header, const SessionStarted& body) {
  Database::Use insert = database->Prepare(
      "INSERT INTO session(uuid, vehicle, source, version, vocabulary_hash, settings, width, height, fx, fy, cx, cy, "
      "start_utime, num_frames, is_derived) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, 1)");
  insert->bind(1, header.session);
  insert->bind(2, body.vehicle);
  insert->bind(3, body.source);
  insert->bind(4, body.version);
  insert->bind(5, body.vocabulary_hash);
  insert->bind(6, body.settings_json);
  insert->bind(7, body.pinhole.width);
  insert->bind(8, body.pinhole.height);
  insert->bind(9, body.pinhole.fx);
  insert->bind(10, body.pinhole.fy);
  insert->bind(11, body.pinhole.cx);
  insert->bind(12, body.pinhole.cy);
  insert->bind(13, header.utime);
  insert->bind(14, body.num_frames);
  insert->exec();
  return database->Sql().getLastInsertRowid();
}

void WriteDerivedRows(Database* database, int64_t session, const Record& record) {
  const RecordHeader& header = record.header;
  if (const auto* start = std::get_if<SubmapStarted>(&record.body)) WriteSubmapStart(database, session, header, *start);
  if (const auto* end = std::get_if<SubmapEnded>(&record.body)) WriteSubmapEnd(database, session, header, *end);
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body))
    WriteKeyframeRows(database, session, header, *keyframe);
  if (const auto* update = std::get_if<MapUpdate>(&record.body))
    WriteRemovedKeyframes(database, session, header, *update);
  if (const auto* end = std::get_if<SessionEnded>(&record.body)) {
    Database::Use update = database->Prepare("UPDATE session SET ended = 1, num_frames = ? WHERE id = ?");
    update->bind(1, end->num_frames);
    update->bind(2, session);
    update->exec();
  }
}

void GeometryWriter::WriteKeyframe(Database* database, const SubmapKeyframe& keyframe) {
  const auto pose = ToArray(keyframe.cam_from_submap);
  std::vector<int32_t> points, covisible;
  for (const MapPointId id : keyframe.map_points) points.push_back(id.value);
  for (const KeyframeId id : CovisibleKeyframes(submap_, keyframe.id)) covisible.push_back(id.value);
  Database::Use insert = database->Prepare(
      "INSERT OR REPLACE INTO keyframe_geometry(session, keyframe, cam_from_submap, observations, covisible) "
      "VALUES(?, ?, ?, ?, ?)");
  insert->bind(1, session_);
  insert->bind(2, keyframe.id.value);
  insert->bindNoCopy(3, pose.data(), static_cast<int>(sizeof(pose)));
  const std::vector<uint8_t> observations = PackObservations(points);
  BindBlob(insert.get(), 4, observations);
  BindBlob(insert.get(), 5, covisible);
  insert->exec();
}

void GeometryWriter::WritePoints(Database* database) {
  std::vector<int32_t> ids;
  std::vector<float> positions;
  auto it = submap_.points.lower_bound(next_point_);
  for (; it != submap_.points.end() && ids.size() < kPointsPerChunk; ++it) {
    ids.push_back(it->first.value);
    for (int i = 0; i < 3; ++i) positions.push_back(it->second.position[i]);
  }
  Database::Use insert = database->Prepare(
      "INSERT OR REPLACE INTO map_points(session, submap, chunk, count, ids, positions) VALUES(?, ?, ?, ?, ?, ?)");
  insert->bind(1, session_);
  insert->bind(2, submap_.id.value);
  insert->bind(3, chunk_++);
  insert->bind(4, static_cast<int>(ids.size()));
  BindBlob(insert.get(), 5, ids);
  BindBlob(insert.get(), 6, positions);
  insert->exec();
  next_point_ = MapPointId(ids.back() + 1);
}

void GeometryWriter::WriteSummary(Database* database) {
  std::vector<FrameRow> frames;
  for (const TrackedFrame& frame : submap_.frames) {
    FrameRow row{frame.frame, frame.keyframe.value, frame.utime, {}};
    const auto pose = ToArray(frame.cam_from_keyframe);
    std::copy(pose.begin(), pose.end(), row.cam_from_keyframe);
    frames.push_back(row);
  }
  Database::Use update = database->Prepare(
      "UPDATE submap SET has_geometry = 1, num_keyframes = ?, num_points = ?, num_frames = ?, frames = ? "
      "WHERE session = ? AND submap = ?");
  update->bind(1, static_cast<int>(submap_.keyframes.size()));
  update->bind(2, static_cast<int>(submap_.points.size()));
  update->bind(3, static_cast<int>(submap_.frames.size()));
  BindBlob(update.get(), 4, frames);
  update->bind(5, session_);
  update->bind(6, submap_.id.value);
  update->exec();
}

bool GeometryWriter::Step(Database* database) {
  // Progress is kept only if the transaction is: a full disk lets the same step be tried again.
  const KeyframeId keyframe_before = next_keyframe_;
  const MapPointId point_before = next_point_;
  const int chunk_before = chunk_;
  bool done = false;
  try {
    SQLite::Transaction transaction(database->Sql());
    auto keyframe = submap_.keyframes.lower_bound(next_keyframe_);
    if (keyframe != submap_.keyframes.end()) {
      for (int i = 0; i < kKeyframesPerStep && keyframe != submap_.keyframes.end(); ++i, ++keyframe) {
        WriteKeyframe(database, keyframe->second);
        next_keyframe_ = KeyframeId(keyframe->first.value + 1);
      }
    } else if (submap_.points.lower_bound(next_point_) != submap_.points.end()) {
      WritePoints(database);
    } else {
      WriteSummary(database);
      done = true;
    }
    transaction.commit();
  } catch (...) {
    next_keyframe_ = keyframe_before;
    next_point_ = point_before;
    chunk_ = chunk_before;
    throw;
  }
  return done;
}

void RebuildDerivedRows(Database* database, const SessionRow& session) {
  SQLite::Transaction transaction(database->Sql());
  for (const char* table : {"submap", "keyframe", "keyframe_bow", "keyframe_geometry", "map_points"}) {
    Database::Use remove = database->Prepare(std::string("DELETE FROM ") + table + " WHERE session = ?");
    remove->bind(1, session.id);
    remove->exec();
  }
  database->ReadRecords(session, 0, session.cumulative, [&](const EncodedRecord& encoded) {
    const DecodedRecord decoded =
        DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    if (decoded.record) WriteDerivedRows(database, session.id, *decoded.record);
    return true;
  });
  Database::Use update = database->Prepare("UPDATE session SET is_derived = 1 WHERE id = ?");
  update->bind(1, session.id);
  update->exec();
  transaction.commit();
}

}  // namespace mapmend

#include "procs/submap_store/schema.h"

#include <string>

#include "procs/submap_store/row_checksum.h"

namespace mapmend {
namespace {

// Released steps are never edited: a new version is a new step.
const char* const kSteps[kSchemaVersion] = {
    // 1: the stream as it came.
    R"sql(
CREATE TABLE session(
  id INTEGER PRIMARY KEY,
  uuid TEXT NOT NULL UNIQUE,
  vehicle TEXT NOT NULL,
  source TEXT NOT NULL,
  version TEXT NOT NULL,
  vocabulary_hash TEXT NOT NULL,
  settings TEXT NOT NULL,
  width INTEGER NOT NULL,
  height INTEGER NOT NULL,
  fx REAL NOT NULL, fy REAL NOT NULL, cx REAL NOT NULL, cy REAL NOT NULL,
  start_utime INTEGER NOT NULL,
  ended INTEGER NOT NULL DEFAULT 0,
  num_frames INTEGER NOT NULL DEFAULT 0
);
CREATE TABLE record(
  session INTEGER NOT NULL REFERENCES session(id),
  seq INTEGER NOT NULL,
  channel TEXT NOT NULL,
  utime INTEGER NOT NULL,
  payload BLOB NOT NULL,
  PRIMARY KEY(session, seq)
);
CREATE TABLE gap(
  session INTEGER NOT NULL REFERENCES session(id),
  first_seq INTEGER NOT NULL,
  last_seq INTEGER NOT NULL,
  reason TEXT NOT NULL,
  PRIMARY KEY(session, first_seq)
);
)sql",
    // 2: what the stream says, in tables.
    R"sql(
ALTER TABLE session ADD COLUMN is_derived INTEGER NOT NULL DEFAULT 0;
CREATE TABLE submap(
  session INTEGER NOT NULL REFERENCES session(id),
  submap INTEGER NOT NULL,
  start_seq INTEGER NOT NULL,
  start_utime INTEGER NOT NULL,
  end_seq INTEGER,
  end_utime INTEGER,
  end_reason TEXT,
  end_detail TEXT,
  last_frame INTEGER,
  has_geometry INTEGER NOT NULL DEFAULT 0,
  num_keyframes INTEGER,
  num_points INTEGER,
  num_frames INTEGER,
  frames BLOB,
  PRIMARY KEY(session, submap)
);
CREATE TABLE keyframe(
  session INTEGER NOT NULL REFERENCES session(id),
  keyframe INTEGER NOT NULL,
  submap INTEGER NOT NULL,
  seq INTEGER NOT NULL,
  utime INTEGER NOT NULL,
  frame INTEGER NOT NULL,
  num_features INTEGER NOT NULL,
  removed_seq INTEGER,
  PRIMARY KEY(session, keyframe)
) WITHOUT ROWID;
CREATE TABLE keyframe_bow(
  session INTEGER NOT NULL REFERENCES session(id),
  keyframe INTEGER NOT NULL,
  words BLOB NOT NULL,
  weights BLOB NOT NULL,
  PRIMARY KEY(session, keyframe)
);
CREATE TABLE keyframe_geometry(
  session INTEGER NOT NULL REFERENCES session(id),
  keyframe INTEGER NOT NULL,
  cam_from_submap BLOB NOT NULL,
  map_points BLOB NOT NULL,
  covisible BLOB NOT NULL,
  PRIMARY KEY(session, keyframe)
);
CREATE TABLE map_points(
  session INTEGER NOT NULL REFERENCES session(id),
  submap INTEGER NOT NULL,
  chunk INTEGER NOT NULL,
  count INTEGER NOT NULL,
  ids BLOB NOT NULL,
  positions BLOB NOT NULL,
  PRIMARY KEY(session, submap, chunk)
);
CREATE VIEW loss_event AS
  SELECT session, submap, end_seq AS seq, end_utime AS utime, last_frame, end_reason AS reason, end_detail AS detail
  FROM submap WHERE end_reason IS NOT NULL AND end_reason <> 'end_of_input';
)sql",
    // 3: the merged map.
    R"sql(
CREATE TABLE revision(
  revision INTEGER PRIMARY KEY,
  refined INTEGER NOT NULL,
  final INTEGER NOT NULL,
  num_parts INTEGER NOT NULL,
  payload BLOB NOT NULL
);
CREATE TABLE revision_part(
  revision INTEGER NOT NULL,
  part INTEGER NOT NULL,
  session TEXT NOT NULL,
  submap INTEGER NOT NULL,
  payload BLOB NOT NULL,
  PRIMARY KEY(revision, part)
);
CREATE TABLE merged_submap(
  revision INTEGER NOT NULL,
  session TEXT NOT NULL,
  submap INTEGER NOT NULL,
  component INTEGER NOT NULL,
  is_root INTEGER NOT NULL,
  tx REAL NOT NULL, ty REAL NOT NULL, tz REAL NOT NULL,
  qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL,
  scale REAL NOT NULL,
  PRIMARY KEY(revision, session, submap)
);
CREATE TABLE connection(
  revision INTEGER NOT NULL,
  session_a TEXT NOT NULL,
  submap_a INTEGER NOT NULL,
  session_b TEXT NOT NULL,
  submap_b INTEGER NOT NULL,
  verdict INTEGER NOT NULL,
  reason TEXT NOT NULL,
  num_connected_frames INTEGER NOT NULL,
  num_common_points INTEGER NOT NULL,
  median_angle_deg REAL NOT NULL,
  strength REAL NOT NULL,
  num_inliers INTEGER NOT NULL,
  scale REAL NOT NULL,
  in_tree INTEGER NOT NULL
);
CREATE INDEX connection_revision ON connection(revision);
)sql",
    // 4: what a person decided about connections.
    R"sql(
CREATE TABLE edge_decision(
  number INTEGER PRIMARY KEY,
  session_a TEXT NOT NULL,
  submap_a INTEGER NOT NULL,
  session_b TEXT NOT NULL,
  submap_b INTEGER NOT NULL,
  disabled INTEGER NOT NULL
);
)sql",
    // 5: observations take two bytes instead of four a feature; the store writes them anew when it opens the file.
    R"sql(
DELETE FROM keyframe_geometry;
ALTER TABLE keyframe_geometry RENAME COLUMN map_points TO observations;
UPDATE submap SET has_geometry = 0;
)sql",
    // 6: what cannot be made again from something else carries a checksum. It is what tells damage: never NULL.
    R"sql(
ALTER TABLE record ADD COLUMN checksum INTEGER;
ALTER TABLE gap ADD COLUMN checksum INTEGER;
ALTER TABLE revision ADD COLUMN checksum INTEGER;
ALTER TABLE revision_part ADD COLUMN checksum INTEGER;
ALTER TABLE edge_decision ADD COLUMN checksum INTEGER;
UPDATE record SET checksum = row_checksum(channel, payload);
UPDATE gap SET checksum = row_checksum(first_seq, last_seq, reason);
UPDATE revision SET checksum = row_checksum(revision, refined, final, num_parts, payload);
UPDATE revision_part SET checksum = row_checksum(revision, part, session, submap, payload);
UPDATE edge_decision SET checksum = row_checksum(number, session_a, submap_a, session_b, submap_b, disabled);
)sql",
};

}  // namespace

void Migrate(SQLite::Database* database, int version) {
  AddRowChecksum(database);
  int at = database->execAndGet("PRAGMA user_version").getInt();
  for (; at < version; ++at) {
    SQLite::Transaction transaction(*database);
    database->exec(kSteps[at]);
    database->exec("PRAGMA user_version = " + std::to_string(at + 1));
    transaction.commit();
  }
}

}  // namespace mapmend

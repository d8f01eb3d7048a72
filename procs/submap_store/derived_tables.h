#pragma once

#include <cstdint>

#include "libs/stream/submap.h"
#include "procs/submap_store/database.h"

// Writes what the stream says into tables (docs/file_formats.md). All of it can be made again from the record table.
namespace mapmend {

// Rows that belong to one record: the session, a submap's begin or end, a keyframe and its words, culled keyframes.
// Call in the transaction that inserts the record. session: the number of the session's row (a SessionStarted makes
// that row).
void WriteDerivedRows(Database* database, int64_t session, const Record& record);

// Inserts the session's row and returns its number.
int64_t InsertSession(Database* database, const RecordHeader& header, const SessionStarted& body);

// Writes the final geometry of a submap that has ended: poses, observed points and covisible keyframes of each
// keyframe, then map points, tracked frames and counts. In steps, each a short transaction of its own, so that a large
// submap does not hold up the records that arrive meanwhile.
class GeometryWriter {
 public:
  GeometryWriter(int64_t session, Submap submap) : session_(session), submap_(std::move(submap)) {}

  // Writes one more step. True when all is written.
  bool Step(Database* database);
  int64_t session() const { return session_; }
  const Submap& submap() const { return submap_; }

 private:
  void WriteKeyframe(Database* database, const SubmapKeyframe& keyframe);
  void WritePoints(Database* database);
  void WriteSummary(Database* database);

  int64_t session_;
  Submap submap_;
  KeyframeId next_keyframe_{0};
  MapPointId next_point_{0};
  int chunk_ = 0;
};

// Deletes and writes again all derived rows of a session, the geometry of ended submaps excepted (it is left to
// GeometryWriter), in one transaction.
void RebuildDerivedRows(Database* database, const SessionRow& session);

}  // namespace mapmend

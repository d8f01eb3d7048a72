#include <functional>
#include <utility>

#include "libs/bus/channels.h"
#include "procs/submap_store/blob.h"
#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/derived_check.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

// Follows the records of one session as a consumer does.
void CheckSession(Database* database, const SessionRow& session, DerivedCheck* derived,
                  std::vector<std::string>* problems) {
  const size_t before = problems->size();
  const auto report = [&](int64_t seq, const std::string& what, const std::string& channel = "") {
    problems->push_back("session " + session.uuid + ", record " + std::to_string(seq) + DescribeChannel(channel) +
                        ": " + what);
  };
  const std::vector<GapRow> gaps = database->Gaps(session.id);
  size_t gap = 0;
  int64_t expected = 0;
  Session model;
  const auto follow = [&](int64_t seq) {
    while (gap < gaps.size() && gaps[gap].first_seq == expected) expected = gaps[gap++].last_seq + 1;
    if (seq != expected) report(expected, "is missing and not in the gap table");
    expected = seq + 1;
  };
  database->ReadRecords(
      session, 0, session.cumulative,
      [&](const EncodedRecord& encoded) {
        follow(encoded.seq);
        DecodedRecord decoded =
            DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
        if (!decoded.record) {
          report(encoded.seq, decoded.error);
          return true;
        }
        // What depends on a lost or damaged record is no damage: it stays as it is, for that one may come back.
        const std::string error = ApplyLight(*decoded.record, &model);
        if (!error.empty() && gap == 0 && problems->size() == before) report(encoded.seq, error);
        derived->OnRecord(session, *decoded.record);
        if (const auto* end = std::get_if<SubmapEnded>(&decoded.record->body)) {
          const auto submap = model.submaps.find(end->submap);
          if (submap != model.submaps.end() && submap->second.ended) {
            Submap stub;  // nothing refers to it any more
            stub.ended = true;
            derived->OnSubmapEnded(session, std::exchange(submap->second, std::move(stub)));
          }
        }
        return true;
      },
      [&](int64_t seq, const std::string& channel, const std::string& what) {
        follow(seq);
        report(seq, what, channel);
      });
  follow(session.cumulative + 1);
  if (model.ended != session.ended)
    report(session.cumulative, "the session table and the records disagree about its end");
  // Without all records the rows cannot be made again.
  if (problems->size() == before) derived->FinishSession(session, problems);
}

void CheckRevisions(Database* database, DerivedCheck* derived, std::vector<std::string>* problems) {
  auto revisions = database->Prepare(
      "SELECT revision, payload, checksum IS row_checksum(revision, refined, final, num_parts, payload) FROM revision "
      "ORDER BY revision");
  while (revisions->executeStep()) {
    const std::string name = "revision " + std::to_string(revisions->getColumn(0).getInt64());
    if (revisions->getColumn(2).getInt() == 0) {
      problems->push_back("merged map, " + name + ": its checksum does not fit");
    } else {
      derived->OnRevision(ReadBlob<uint8_t>(revisions->getColumn(1)));
    }
  }
  auto parts = database->Prepare(
      "SELECT revision, part FROM revision_part WHERE checksum IS NOT row_checksum(revision, part, session, submap, "
      "payload) ORDER BY revision, part");
  while (parts->executeStep()) {
    problems->push_back("merged map, revision " + std::to_string(parts->getColumn(0).getInt64()) + ", part " +
                        std::to_string(parts->getColumn(1).getInt64()) + ": its checksum does not fit");
  }
  derived->FinishRevisions(problems);
}

void CheckPeople(Database* database, std::vector<std::string>* problems) {
  auto decisions = database->Prepare(
      "SELECT number FROM edge_decision WHERE checksum IS NOT row_checksum(number, session_a, submap_a, session_b, "
      "submap_b, disabled)");
  while (decisions->executeStep()) {
    problems->push_back("decision " + decisions->getColumn(0).getString() +
                        " on a connection: its checksum does not fit");
  }
  auto gaps = database->Prepare(
      "SELECT s.uuid, first_seq FROM gap g LEFT JOIN session s ON s.id = g.session WHERE s.uuid IS NULL OR "
      "g.checksum IS NOT row_checksum(first_seq, last_seq, reason)");
  while (gaps->executeStep()) {
    problems->push_back("session " + gaps->getColumn(0).getString() + ", gap from record " +
                        gaps->getColumn(1).getString() + " on: its checksum does not fit");
  }
}

}  // namespace

std::string DescribeChannel(const std::string& channel) {
  if (channel == channels::kKeyframe) return " (keyframe)";
  if (channel == channels::kMapUpdate) return " (map update)";
  if (channel == channels::kWideFeatures) return " (wide features)";
  if (channel == channels::kPositions) return " (positions)";
  if (channel == channels::kSubmap) return " (start or end of a submap)";
  if (channel == channels::kSession) return " (start or end of the session)";
  return "";
}

std::vector<std::string> CheckDb(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  DerivedCheck derived(&database);
  std::vector<std::string> problems;
  // Each step says what it finds, whatever the others found.
  const auto step = [&](const std::function<void()>& check) {
    try {
      check();
    } catch (const SQLite::Exception& e) {
      if (!IsDamage(e)) throw;
      const std::string line = path + ": " + e.what();
      if (problems.empty() || problems.back() != line) problems.push_back(line);
    }
  };
  step([&] {
    auto integrity = database.Prepare("PRAGMA integrity_check");
    while (integrity->executeStep()) {
      const std::string line = integrity->getColumn(0).getString();
      if (line != "ok") problems.push_back(path + ": " + line);
    }
  });
  step([&] { derived.CheckSchema(&problems); });
  std::vector<SessionRow> sessions;
  step([&] { sessions = database.Sessions(); });
  for (const SessionRow& session : sessions) step([&] { CheckSession(&database, session, &derived, &problems); });
  step([&] { CheckRevisions(&database, &derived, &problems); });
  step([&] { CheckPeople(&database, &problems); });
  return problems;
}

}  // namespace mapmend

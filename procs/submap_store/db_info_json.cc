#include <nlohmann/json.hpp>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/db_images.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/schema.h"

namespace mapmend {
namespace {

using Json = nlohmann::ordered_json;

Json Describe(Database* database, const SessionRow& session) {
  Json json = {{"session", session.uuid},  {"vehicle", session.vehicle},
               {"source", session.source}, {"records", session.cumulative + 1},
               {"ended", session.ended},   {"submaps", Json::array()},
               {"gaps", Json::array()}};
  auto rows = database->Prepare(
      "SELECT submap, (SELECT count(*) FROM keyframe k WHERE k.session = s.session AND k.submap = s.submap AND "
      "removed_seq IS NULL), ifnull(num_points, -1), ifnull(num_frames, -1), ifnull(end_reason, ''), "
      "ifnull(end_detail, '') FROM submap s WHERE session = ? ORDER BY submap");
  rows->bind(1, session.id);
  while (rows->executeStep()) {
    Json submap = {{"submap", rows->getColumn(0).getInt()}, {"keyframes", rows->getColumn(1).getInt()}};
    if (rows->getColumn(2).getInt() >= 0) {
      submap["points"] = rows->getColumn(2).getInt();
      submap["frames"] = rows->getColumn(3).getInt();
    }
    submap["end_reason"] = rows->getColumn(4).getString();
    submap["end_detail"] = rows->getColumn(5).getString();
    json["submaps"].push_back(submap);
  }
  for (const GapRow& gap : database->Gaps(session.id)) {
    json["gaps"].push_back({{"first", gap.first_seq}, {"last", gap.last_seq}, {"reason", gap.reason}});
  }
  return json;
}

}  // namespace

std::string DbInfoJson(const std::string& path) {
  const ImageTotals images = CountImages(path);  // before the file is opened here
  Database database(path, Database::Mode::kReadOnly);
  Json json = {{"file", path}, {"schema", kSchemaVersion}, {"vocabulary", ""}, {"sessions", Json::array()}};
  for (const SessionRow& session : database.Sessions()) {
    json["vocabulary"] = session.vocabulary_hash;
    json["sessions"].push_back(Describe(&database, session));
  }
  json["images"] = {{"stored", images.stored}, {"missing", images.missing}, {"bytes", images.bytes}};
  json["merged"] = nullptr;
  const int64_t newest = RevisionStore(&database).NewestComplete();
  if (newest >= 0) {
    auto counts = database.Prepare(
        "SELECT count(*), count(DISTINCT component), (SELECT count(*) FROM connection WHERE revision = ?1 AND verdict "
        "= "
        "0) FROM merged_submap WHERE revision = ?1");
    counts->bind(1, newest);
    if (counts->executeStep()) {
      json["merged"] = {{"revision", newest},
                        {"submaps", counts->getColumn(0).getInt()},
                        {"components", counts->getColumn(1).getInt()},
                        {"connections_accepted", counts->getColumn(2).getInt()}};
    }
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace mapmend

#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <string>

#include "libs/bus/bus.h"
#include "libs/wire/codec.h"
#include "procs/submap_store/submap_store.h"
#include "tests/synthetic_stream.h"

namespace mapmend {

inline void FillWithFlight(const std::string& path, const SyntheticStreamOptions& flight) {
  SubmapStoreOptions options;
  options.path = path;
  SubmapStore store(options);
  for (const Record& record : MakeSyntheticStream(flight)) {
    const EncodedRecord encoded = EncodeRecord(record);
    store.OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
  }
  store.CommitReady(0);
  while (store.WorkInBackground()) continue;
}

// A flight of two submaps, a merged map of them, a person's decision; nothing of it is a real map.
inline void FillWithMap(const std::string& path) {
  SyntheticStreamOptions flight;
  FillWithFlight(path, flight);
  Database database(path, Database::Mode::kReadWrite);
  RevisionStore revisions(&database);
  revision_t revision{};
  revision.transforms.revision = 5;
  revision.transforms.is_final = 1;
  for (int i = 0; i < 2; ++i) {
    merged_submap_t submap{};
    submap.session = flight.session;
    submap.submap = i;
    submap.root_from_submap[6] = 1;
    submap.root_from_submap[7] = 1.25;
    revision.transforms.submaps.push_back(submap);
  }
  revision.transforms.num_submaps = 2;
  connection_t connection{};
  connection.session_a = connection.session_b = flight.session;
  connection.submap_b = 1;
  connection.strength = 12.5;
  connection.reason = "30 inliers";
  connection.b_from_a[6] = connection.b_from_a[7] = 1;
  revision.connections = {connection};
  revision.num_connections = 1;
  revision.num_parts = 2;
  const auto data = EncodeMessage(revision);
  revisions.Store(data.data(), static_cast<int>(data.size()));
  for (int i = 0; i < 2; ++i) {
    revision_part_t part{};
    part.revision = 5;
    part.part = part.submap = i;
    part.session = flight.session;
    part.num_points = 400;
    for (int p = 0; p < part.num_points; ++p) part.point.push_back(p);
    part.num_position_values = 3 * part.num_points;
    part.position.assign(static_cast<size_t>(part.num_position_values), 0.5f + static_cast<float>(i));
    const auto bytes = EncodeMessage(part);
    revisions.StorePart(bytes.data(), static_cast<int>(bytes.size()));
  }
  edge_request_t request{};
  edge_decision_t decision{};
  decision.session_a = decision.session_b = flight.session;
  decision.submap_b = 1;
  decision.disabled = 1;
  request.decisions = {decision};
  request.num_decisions = 1;
  EdgeDecisions(&database).Decide(request);
  database.Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
}

}  // namespace mapmend

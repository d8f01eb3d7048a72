#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>

#include "libs/wire/codec.h"
#include "libs/wire/revision_codec.h"
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
  RevisionHead head;
  head.transforms.revision = 5;
  head.transforms.is_final = true;
  for (int i = 0; i < 2; ++i) {
    MergedTransforms::Place place{{flight.session, SubmapId(i)}, 0, {}, false};
    place.root_from_submap.scale = 1.25;
    head.transforms.submaps.push_back(place);
  }
  EvaluatedConnection connection;
  connection.a = {flight.session, SubmapId(0)};
  connection.b = {flight.session, SubmapId(1)};
  connection.verdict = EvaluatedConnection::Verdict::kAccepted;
  connection.strength = 12.5;
  connection.reason = "30 inliers";
  head.connections = {connection};
  head.num_parts = 2;
  const auto data = Encode(head);
  revisions.Store(data.data(), static_cast<int>(data.size()));
  for (int i = 0; i < 2; ++i) {
    RevisionPart part{5, i, {{flight.session, SubmapId(i)}, {}, {}, {}}};
    const float at = 0.5f + static_cast<float>(i);
    for (int p = 0; p < 400; ++p) part.submap.points.push_back({MapPointId(p), {at, at, at}});
    const auto bytes = Encode(part);
    revisions.StorePart(bytes.data(), static_cast<int>(bytes.size()));
  }
  EdgeDecisions(&database).Decide(EdgeRequest{Addressed(), {{connection.a, connection.b, true}}});
  database.Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
}

}  // namespace mapmend

#include "procs/viewer_export/edge_tool.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include "libs/base/write_file.h"
#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "libs/map_view/snapshot.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_consumer.h"
#include "procs/viewer_export/connection_picture.h"
#include "procs/viewer_export/picture_store.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kPatience = std::chrono::seconds(30);  // without progress

// All that the store has now.
void ReadAll(Bus* bus, StoreClient* store, MapModel* model) {
  StreamConsumer consumer(bus, store, [model](const Record& record) { model->Apply(record); });
  const auto sessions = store->Fetch(FetchRequest{});
  if (!sessions) throw std::runtime_error("the store does not answer");
  const auto has_all = [&] {
    const std::vector<StreamConsumer::Cursor> cursors = consumer.Cursors();
    return std::all_of(sessions->sessions.begin(), sessions->sessions.end(), [&](const StreamCursor& wanted) {
      return std::any_of(cursors.begin(), cursors.end(), [&](const StreamConsumer::Cursor& cursor) {
        return cursor.session == wanted.session && cursor.seq >= wanted.seq;
      });
    });
  };
  auto last_progress = Clock::now();
  while (!has_all()) {
    if (consumer.Spin(50, 64) > 0) last_progress = Clock::now();
    if (StopRequested()) throw std::runtime_error("interrupted");
    if (Clock::now() - last_progress > kPatience) throw std::runtime_error("the store does not answer");
  }
  auto stored = store->FetchRevision(-1);
  if (!stored.error.empty()) throw std::runtime_error(stored.error);
  if (stored.status == StoreClient::RevisionStatus::kNoAnswer) throw std::runtime_error("the store does not answer");
  if (stored.status != StoreClient::RevisionStatus::kOk)
    throw std::runtime_error("there is no merged map yet; `mapmend merge` makes one");
  model->SetRevision(std::move(stored.revision));
}

}  // namespace

SubmapKey ParseSubmapKey(const std::string& text) {
  const size_t colon = text.rfind(':');
  int number = -1;
  const char* end = text.data() + text.size();
  if (colon != std::string::npos) {
    const auto [stop, error] = std::from_chars(text.data() + colon + 1, end, number);
    if (error == std::errc() && stop == end && number >= 0) return {text.substr(0, colon), SubmapId(number)};
  }
  throw std::runtime_error("submap '" + text + "': give SESSION:NUMBER");
}

void ShowEdge(Bus* bus, const SubmapKey& a, const SubmapKey& b, const std::string& path) {
  StoreClient store(bus, "edge-" + std::to_string(getpid()));
  MapModel model;
  ReadAll(bus, &store, &model);
  const Snapshot snapshot = MakeSnapshot(model);
  const auto& connections = model.Revision().connections;
  const auto connection = std::find_if(connections.begin(), connections.end(), [&](const EvaluatedConnection& c) {
    return (c.a == a && c.b == b) || (c.a == b && c.b == a);
  });
  if (connection == connections.end()) {
    throw std::runtime_error(
        "these two submaps were not compared: nothing looked alike in them, and no time lies "
        "between them that could be bridged");
  }
  const std::vector<uint8_t> picture = DrawConnection(snapshot, *connection, PicturesOf(&store));
  if (picture.empty()) throw std::runtime_error("there is nothing to show: no two of their keyframes look alike");
  WriteFile(path, std::string(picture.begin(), picture.end()));
  std::printf("%s%s: %s\n%s\n", ToString(connection->verdict), connection->in_tree ? ", in the tree" : "",
              connection->reason.c_str(), path.c_str());
}

}  // namespace mapmend

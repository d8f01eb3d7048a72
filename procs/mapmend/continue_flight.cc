#include "procs/mapmend/continue_flight.h"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "libs/stream/session_id.h"
#include "libs/wire/codec.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

// The session's first record; nullopt if it is lost.
std::optional<SessionStarted> ReadStart(StoreClient* store, const std::string& session) {
  const auto reply = store->Fetch({Addressed(), session, 0, 0, 1});
  if (!reply) throw std::runtime_error("the submap store does not answer");
  if (reply->records.size() != 1) return std::nullopt;
  DecodedRecord decoded = DecodeRecord(reply->records[0]);
  if (!decoded.record) return std::nullopt;
  if (auto* start = std::get_if<SessionStarted>(&decoded.record->body)) return std::move(*start);
  return std::nullopt;
}

// Frames before it were left to the session that this one continues.
int FirstFrameOf(const SessionStarted& start) {
  const auto settings = nlohmann::json::parse(start.settings_json, nullptr, false);
  return settings.is_object() ? settings.value("first_frame", 0) : 0;
}

// As the frontend calls its input.
std::string SourceOf(const RunOptions& options) {
  if (options.live) return options.source.empty() ? "live camera" : options.source;
  const auto first = std::filesystem::absolute(options.inputs.front()).lexically_normal();
  const std::string name = (first.filename().empty() ? first.parent_path() : first).filename().string();
  return options.inputs.size() == 1 ? name : name + " and " + std::to_string(options.inputs.size() - 1) + " more";
}

}  // namespace

FlightPart FindFlightPart(Backend* backend, const RunOptions& options, const std::string& fresh_session) {
  StoreClient store(backend->bus(), "continue-" + std::to_string(getpid()));
  const std::string source = SourceOf(options);
  const auto sessions = ListSessions(backend->bus());
  std::string last;
  SessionStarted start;
  for (auto it = sessions.rbegin(); it != sessions.rend() && last.empty(); ++it) {
    const auto candidate = ReadStart(&store, it->id);
    if (!candidate) continue;
    const bool is_wanted = options.session.empty()
                               ? candidate->source == source && candidate->vehicle == options.vehicle
                               : it->id == options.session;
    if (!is_wanted) continue;
    last = it->id;
    start = *candidate;
  }
  FlightPart part;
  part.session = fresh_session;
  if (last.empty()) return part;
  const auto progress = store.AskProgress(last);
  if (!progress) throw std::runtime_error("the submap store does not answer");
  part.first_frame = std::max(FirstFrameOf(start), progress->last_frame + 1);
  if (!progress->ended) {
    part.session = last;
    // A session that continues another one keeps saying so.
    const auto settings = nlohmann::json::parse(start.settings_json, nullptr, false);
    if (settings.is_object()) part.continues = settings.value("continues", "");
  } else {
    part.session = SessionIdFromText(last + "|continued");
    part.continues = last;
  }
  return part;
}

}  // namespace mapmend

#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "procs/mapmend/backend.h"

// What a power cut, a crash or a kill leaves in a folder of results is put in order here: records that wait in an
// outbox are handed to the store, sessions whose frontend is gone are ended.
namespace mapmend {

struct RescueReport {
  std::vector<std::string> lines;  // what was found and done, for a person
  bool changed = false;            // the stream has more records than before
};

// True if records lie in the folder that no store has acknowledged.
bool HoldsUndelivered(const std::string& folder);

// Delivers every outbox in the folder. Throws std::runtime_error naming the file if one cannot be delivered (it is left
// as it is), or as Backend::Tick does.
RescueReport DeliverOutboxes(Backend* backend, const std::string& folder);
// Ends every session of the store that is still open, except those named. Only for a bus on which no frontend is.
// Throws std::runtime_error if the store does not answer or cannot write, or as Backend::Tick does.
RescueReport CloseSessions(Backend* backend, const std::set<std::string>& except = {});
// Both, one after the other.
RescueReport RescueFolder(Backend* backend, const std::string& folder);

// Ends one session. Returns its last record; nullopt if its frontend is heard, or the store does not know it or does
// not answer in time. Throws as Backend::Tick does.
std::optional<int64_t> RescueSession(Backend* backend, const std::string& session);

// The sessions that the store holds, oldest first. Throws std::runtime_error if it does not answer.
struct StoredSession {
  std::string id;
  int64_t last_seq = -1;
};
std::vector<StoredSession> ListSessions(Bus* bus);
std::set<std::string> SessionNames(Bus* bus);

}  // namespace mapmend

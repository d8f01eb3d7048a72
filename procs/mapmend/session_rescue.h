#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "procs/mapmend/backend.h"

namespace mapmend {

// After a frontend has died in the middle of a flight: hands the store what lies in its outbox and has the store end
// the session, so that what it saw becomes a finished map. Returns the session's last record; nullopt if the store
// knows nothing of the session or does not answer in time. Throws as Backend::Tick does.
std::optional<int64_t> RescueSession(Backend* backend, const std::string& session, const std::string& outbox_path);

// The sessions that the store holds, oldest first. Throws std::runtime_error if it does not answer.
struct StoredSession {
  std::string id;
  int64_t last_seq = -1;
};
std::vector<StoredSession> ListSessions(Bus* bus);

}  // namespace mapmend

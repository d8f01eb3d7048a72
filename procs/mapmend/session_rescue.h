#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "procs/mapmend/backend.h"

namespace mapmend {

// After a frontend has died in the middle of a flight: hands the store what lies in its outbox and has the store end
// the session, so that what it saw becomes a finished map. Returns the session's last record; nullopt if the store
// knows nothing of the session or does not answer in time. Throws as Backend::Tick does.
std::optional<int64_t> RescueSession(Backend* backend, const std::string& session, const std::string& outbox_path);

}  // namespace mapmend

#include "libs/merging/flight_seed.h"

#include <nlohmann/json.hpp>

namespace mapmend {

std::optional<uint64_t> SeedOfFlights(const std::map<std::string, Session>& sessions) {
  const Session* newest = nullptr;
  for (const auto& [id, session] : sessions) {
    if (newest == nullptr || session.start_utime >= newest->start_utime) newest = &session;
  }
  if (newest == nullptr) return std::nullopt;
  const auto settings =
      nlohmann::json::parse(newest->info.settings_json, nullptr, false);  // of a file: may be anything
  if (!settings.is_object() || !settings.contains("seed") || !settings["seed"].is_number_unsigned())
    return std::nullopt;
  return settings["seed"].get<uint64_t>();
}

}  // namespace mapmend

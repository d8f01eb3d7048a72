#include "procs/mapmend/export_settings.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "libs/formats/map_formats.h"
#include "procs/mapmend/run_summary.h"

namespace mapmend {

void ExportSettings::AddOptions(CLI::App* sub) {
  std::string names;
  for (const MapFormat& format : MapFormats()) {
    if (!format.is_always_written) names += (names.empty() ? "" : ", ") + format.name;
  }
  sub->add_option("--format", given_,
                  "formats to write beside TUM, PLY and COLMAP, separated by commas: " + names +
                      " (those that are there are kept up to date)");
  sub->add_option(
         "--frame", frame,
         "of everything that is written: map (the first submap's own), level (ground horizontal, z up), both in "
         "an arbitrary unit; with positions enu (east, north, up from the first one, metres) or utm (default: as "
         "before, else map)")
      ->check(CLI::IsMember(FrameNames()));
}

void ExportSettings::AddMosaicOption(CLI::App* sub) {
  sub->add_option("--mosaic", mosaic,
                  "the picture of the ground: live (tiles in mosaic.mbtiles while the map grows, mosaic.tif at the "
                  "end), final (mosaic.tif only) or none (default: as before, else live)")
      ->check(CLI::IsMember({"live", "final", "none"}));
}

void ExportSettings::Check() { formats = ParseFormats(given_); }

ExportSettings ExportSettings::WithEarlier(const std::string& folder) const {
  ExportSettings settings = *this;
  for (const std::string& format : FormatsIn(folder)) {
    if (std::find(formats.begin(), formats.end(), format) == formats.end()) settings.formats.push_back(format);
  }
  if (!std::filesystem::exists(folder + "/summary.json")) return settings;
  const nlohmann::ordered_json earlier = ReadSummary(folder);
  if (frame.empty()) settings.frame = earlier.value("frame", "");
  if (mosaic.empty() && !earlier.contains("mosaic")) settings.mosaic = "none";
  if (mosaic.empty() && earlier.contains("mosaic"))
    settings.mosaic = std::filesystem::exists(folder + "/mosaic.mbtiles") ? "live" : "final";
  return settings;
}

std::vector<std::string> ExportSettings::Arguments() const {
  std::vector<std::string> arguments;
  if (!frame.empty()) arguments.insert(arguments.end(), {"--frame", frame});
  if (DrawsNothing()) arguments.insert(arguments.end(), {"--set", "mosaic.enabled=false"});
  for (const std::string& format : formats) arguments.insert(arguments.end(), {"--format", format});
  return arguments;
}

}  // namespace mapmend

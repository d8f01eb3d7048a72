#pragma once

#include <string>
#include <vector>

#include "libs/formats/placed_map.h"

// The formats in which a map can be had for other programs, by the names that people type.
namespace mapmend {

struct MapFormat {
  std::string name;                // as typed
  std::vector<std::string> files;  // in the folder of the results
  std::string description;         // for --help and docs
  bool is_always_written = false;  // whether asked for or not
};

// All of them.
const std::vector<MapFormat>& MapFormats();

// "las,mcap" and the like, several texts. Throws UsageError, which lists the known formats, if one is unknown.
std::vector<std::string> ParseFormats(const std::vector<std::string>& texts);

bool IsAlwaysWritten(const std::string& format);

// Names of the frames of reference in which a map can be had: "map", "level", and of maps with positions "enu", "utm".
const std::vector<std::string>& FrameNames();

// Those of the formats written on demand whose files are all in a folder.
std::vector<std::string> FormatsIn(const std::string& folder);

// Writes the files of a format that is not always written into a folder. Throws std::runtime_error with one line.
void WriteFormat(const std::string& name, const PlacedMap& map, const std::string& folder);

}  // namespace mapmend

#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

namespace mapmend {

// What is exported of a map beside what always is.
struct ExportSettings {
  std::vector<std::string> formats;  // names of libs/formats/map_formats.h
  std::string frame;                 // one of FrameNames; empty: that of the exports that are there, else "map"
  // The picture of the ground: live, final or none; empty: as the exports that are there have it, else live.
  std::string mosaic;

  // Adds --mosaic to a command that maps or merges flights.
  void AddMosaicOption(CLI::App* sub);
  // Whether tiles of the ground are drawn while a map grows.
  bool DrawsLive() const { return mosaic.empty() || mosaic == "live"; }
  bool DrawsNothing() const { return mosaic == "none"; }
  // Adds --format and --frame to a command.
  void AddOptions(CLI::App* sub);
  // Throws UsageError. To be called in the command's callback, before anything is started.
  void Check();
  // With what an earlier export into this folder was told, where nothing else is said.
  ExportSettings WithEarlier(const std::string& folder) const;
  // For viewer_export.
  std::vector<std::string> Arguments() const;

 private:
  std::vector<std::string> given_;  // as typed
};

}  // namespace mapmend

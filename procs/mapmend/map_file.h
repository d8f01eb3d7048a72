#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "procs/mapmend/backend.h"
#include "procs/mapmend/out_folder.h"

namespace mapmend {

// What a person names when they mean a map: the folder of a run's results, or a database file.
struct MapPlace {
  std::string db;      // path of the database
  std::string folder;  // of the results; empty if a file was named
};
// Throws std::runtime_error if there is no database.
MapPlace FindMap(const std::string& path);

struct MapFileOptions {
  MapPlace place;
  std::string out;          // folder for the exports; empty: none are written
  std::string vocabulary;   // empty: mapmend's own
  std::string groundtruth;  // empty: the one of the exports that lie in OUT, if it is still there
  std::optional<int> seed;
  std::string log_level = "info";
  bool with_merger = false;
  bool forget_merged = false;  // what an earlier merger made, under whatever numbers, is removed first
};

// The processes on a database file without a flight. Logs go to OUT/logs, or to a temporary folder that goes with the
// object.
class MapFile {
 public:
  // Call InstallSignalHandlers first, once. Throws std::runtime_error with one line, Interrupted.
  explicit MapFile(const MapFileOptions& options);
  ~MapFile();

  Backend* backend() { return backend_.get(); }
  // Ends sessions whose frontend died, waits until merger and viewer have done all of the map, stops everything,
  // completes the exports. Returns the lines to print, empty without exports. Throws as the constructor does, also if
  // there is no merged map to export.
  std::string Finish(const std::function<void(const std::string&)>& show);

 private:
  MapFileOptions options_;
  std::string title_;  // that an earlier run gave the report
  std::string temporary_;
  std::unique_ptr<OutFolder> out_folder_;
  std::unique_ptr<Backend> backend_;
};

}  // namespace mapmend

#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "procs/mapmend/backend.h"
#include "procs/mapmend/export_settings.h"
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
  ExportSettings exports;
  std::optional<int> seed;
  std::string log_level = "info";
  bool with_merger = false;  // the map is merged anew
  int page_port = 0;         // of the live page on the stored map, 0: none; not with a merger
  std::string page_bind;     // its address; empty: this host only
  ProcessSettings settings;  // resolved
};

// The processes on a database file without a flight. Logs go to OUT/logs, or to a temporary folder that goes with the
// object. With a merger they work on a copy of the flights and write their exports into a folder of their own: what was
// there stays as it is until Finish, and if it does not come to that, however it ends.
class MapFile {
 public:
  // Call InstallSignalHandlers first, once. Throws std::runtime_error with one line, Interrupted.
  explicit MapFile(const MapFileOptions& options);
  ~MapFile();

  Backend* backend() { return backend_.get(); }
  // With a merger: what of the flights is damaged, a line each. It is left out; the file as it was is kept.
  const std::vector<std::string>& Problems() const { return problems_; }
  // Ends sessions whose frontend died, waits until merger and viewer have done all of the map, stops everything,
  // completes the exports. Returns the lines to print, empty without exports. Throws as the constructor does, also if
  // there is no merged map to export.
  std::string Finish(const std::function<void(const std::string&)>& show);

 private:
  void CopyFlights(const std::string& logs);
  void TakeOver();
  void RemoveUnfinished();

  MapFileOptions options_;
  std::string title_;           // that an earlier run gave the report
  std::string temporary_;       // for logs
  std::string copy_, exports_;  // of the database, of the exports, while they are made; empty: none
  std::vector<std::string> problems_;
  std::unique_ptr<OutFolder> out_folder_;
  std::unique_ptr<Backend> backend_;
};

// Says on stderr what of a map was damaged and is left out, and ends the command with kExitInputCutShort; nothing if
// there is nothing to say. Not while a MapFile lives: it has stderr in its log.
void TellProblems(const MapPlace& place, const std::vector<std::string>& problems);

}  // namespace mapmend

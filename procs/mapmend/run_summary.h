#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "procs/mapmend/child_process.h"
#include "procs/mapmend/health_monitor.h"

// How many keyframes, without those that were culled, have their image in the map.
struct ImageFigures {
  int stored = 0, missing = 0;
};

// The end of a run: what only the launcher knows goes into summary.json, the report is built again, a table is printed.
namespace mapmend {

struct ShutterFigures {
  double readout_ms = 0;    // from the first line of an image to the last
  bool by_columns = false;  // else by rows
};
// As the merger tells it in its health; nothing if it has not found any.
std::optional<ShutterFigures> FindShutter(const HealthMonitor::Entry* merger);

struct LauncherFigures {
  std::string session;  // the flight that was mapped; empty: none, or several
  std::string title;    // of the report; empty: the name of the folder
  double wall_s = 0;
  std::string mode;                              // of the frontend: lockstep, realtime or live; empty: there was none
  int64_t frames_dropped = 0, bad_messages = 0;  // came while it was busy; were no good
  std::map<std::string, int> untracked;          // frames without a pose when they came, by cause
  int64_t frames_left_out = 0;                   // of a file, that could not be used
  std::optional<double> track_ms_median, track_ms_p95;  // of the frontend, if there was one
  std::string profile_json;                             // as the frontend wrote it; empty: none was asked for
  std::optional<ImageFigures> images;                   // of keyframes
  std::optional<ShutterFigures> shutter;                // a rolling one that the merger found
  std::vector<std::pair<std::string, ResourceUsage>> processes;
};

// OUT/summary.json as it stands. Throws std::runtime_error if the file is missing or no JSON object.
nlohmann::ordered_json ReadSummary(const std::string& out);

// Adds title, wall_s, frontend {mode, frames_dropped, frames_left_out, bad_messages, untracked {}, track_ms_median,
// track_ms_p95, profile []}, processes [], images {stored, missing}, readout_ms, readout_by, and problem (if the main
// map holds less than half of the flight, as DescribeSmallMap tells it), to OUT/summary.json. Throws std::runtime_error
// if the file is missing or no JSON object.
void CompleteSummary(const std::string& out, const LauncherFigures& figures);

// The table for the terminal, from OUT/summary.json. Throws as CompleteSummary does.
std::string FormatSummaryTable(const std::string& out);

}  // namespace mapmend

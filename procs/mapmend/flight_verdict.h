#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

// How a flight has ended, in words: whether the main map holds it, and if not, why and what to try.
namespace mapmend {

struct FlightFigures {
  int frames_in = 0, frames_tracked = 0;
  int frames_in_main = 0;      // of this flight
  int64_t frames_dropped = 0;  // came while the frontend was busy
  int num_parts = 0;           // components of the whole map
  bool joins_a_map = false;    // mapped into a map that was there before
  // Frames that had no pose when they came, by cause as the frontend names it (FrameOutcome::cause); empty if unknown.
  std::map<std::string, int> untracked;
};

// The commonest cause of frames without a pose: a clause for a person ("the images are too dark"), and what to try.
struct CauseInWords {
  std::string why, advice;
};
// A cause that is not known gets its own name.
CauseInWords ExplainCause(const std::string& cause);

// One line if the main map holds less than half of the flight (its dropped frames included), empty if it holds more.
std::string DescribeSmallMap(const FlightFigures& figures);

// The same for one session of summary.json, once it holds what the launcher knows. Empty also for a session that is not
// in it.
std::string DescribeSmallMap(const nlohmann::ordered_json& summary, const std::string& session);

}  // namespace mapmend

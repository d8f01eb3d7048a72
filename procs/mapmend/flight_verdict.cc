#include "procs/mapmend/flight_verdict.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string Percent(int64_t part, int64_t whole) {
  const double percent = whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0;
  return (percent > 0 && percent < 1 ? "under 1" : std::to_string(std::lround(std::floor(percent)))) + " %";
}

std::string Sentence(const FlightFigures& figures, const std::string& why, const std::string& advice) {
  const int64_t flight = figures.frames_in + figures.frames_dropped;
  const std::string share = figures.frames_in_main == 0
                                ? "none of the " + std::to_string(flight) + " frames is in the map"
                                : "only " + std::to_string(figures.frames_in_main) + " of " + std::to_string(flight) +
                                      " frames (" + Percent(figures.frames_in_main, flight) + ") are in the main map";
  return share + ": " + why + (advice.empty() ? "" : ". Try: " + advice);
}

// Causes that are one to a person count together.
std::string Family(const std::string& cause) {
  if (cause == "no_common_motion" || cause == "not_confirmed" || cause == "unsupported_pose" ||
      cause == "inconsistent_motion")
    return "no_common_motion";
  if (cause == "too_few_inliers") return "too_few_matches";
  return cause;
}

}  // namespace

CauseInWords ExplainCause(const std::string& cause) {
  const std::string family = Family(cause);
  if (family == "darkness") return {"the images are too dark", "more light, a longer exposure, a higher gain"};
  if (family == "small_images")
    return {"the images are too small (less than 200 pixels wide)", "the images in full size"};
  if (family == "end_of_input") return {"the flight ends before a map could begin", "a longer flight"};
  if (family == "blur") return {"the images are blurred", "a shorter exposure, a slower flight, another focus"};
  if (family == "input_gap") return {"images are missing in between", "a recording without gaps"};
  if (family == "too_few_features")
    return {"the images show too few features (too small, blurred, or plain ground)",
            "larger images, --features 3000, a lower or slower flight"};
  if (family == "too_few_matches")
    return {"neighbouring frames have too little in common (little overlap, blur, or plain ground)",
            "more frames a second or a slower flight, so that neighbours overlap by two thirds; --features 3000"};
  if (family == "no_common_motion")
    return {"neighbouring frames match, but no motion of this camera explains them (is it the wrong camera file?)",
            "check focal length, distortion and image size in --camera; look for parts of the image that do not move "
            "with the scene"};
  if (family == "no_motion")
    return {"the image hardly moves", "give a flight in which the camera moves; leave the start with --skip-frames"};
  if (family == "no_parallax")
    return {"the camera turns but does not move sideways (no parallax)", "a flight that moves sideways over the scene"};
  if (family == "ambiguous")
    return {
        "no one motion of this camera explains neighbouring frames best (is it the wrong camera file? or flat ground "
        "seen from nearly the same place)",
        "check focal length, distortion and image size in --camera; more motion between frames"};
  if (family == "dropped")
    return {"most frames came while the frontend was busy and were dropped",
            "mapping without --realtime, a smaller --max-dimension, a machine with less load"};
  std::string words = cause;
  std::replace(words.begin(), words.end(), '_', ' ');
  return {words, ""};
}

std::string DescribeSmallMap(const FlightFigures& figures) {
  const int64_t flight = figures.frames_in + figures.frames_dropped;
  if (flight == 0 || 2 * static_cast<int64_t>(figures.frames_in_main) >= flight) return "";
  // What keeps most frames out of the map decides which reason is told.
  const int64_t apart = std::max(0, figures.frames_tracked - figures.frames_in_main);
  const int64_t untracked = std::max(0, figures.frames_in - figures.frames_tracked);
  if (figures.frames_dropped > std::max(apart, untracked)) {
    const CauseInWords words = ExplainCause("dropped");
    return Sentence(figures, words.why, words.advice);
  }
  if (apart > untracked) {
    if (figures.joins_a_map) {
      return Sentence(figures, "the flight shares no ground with the map that was there, or it was not recognised",
                      "a flight that passes over mapped ground; the report says why parts were not joined");
    }
    return Sentence(
        figures,
        "the map is in " + std::to_string(figures.num_parts) + " parts that share no ground, or it was not recognised",
        "flying over ground of another part again; the report says why parts were not joined");
  }
  if (figures.frames_in < 3) return Sentence(figures, "a map needs at least 3 frames with motion between them", "");
  std::map<std::string, int> families;
  for (const auto& [cause, count] : figures.untracked) families[Family(cause)] += count;
  if (families.empty()) return Sentence(figures, "tracking was lost or never started", "");
  const auto commonest = std::max_element(families.begin(), families.end(),
                                          [](const auto& a, const auto& b) { return a.second < b.second; });
  const CauseInWords words = ExplainCause(commonest->first);
  return Sentence(figures, words.why, words.advice);
}

std::string DescribeSmallMap(const OrderedJson& summary, const std::string& session) {
  const OrderedJson sessions = summary.value("sessions", OrderedJson::array());
  const OrderedJson frontend = summary.value("frontend", OrderedJson::object());
  for (const OrderedJson& entry : sessions) {
    if (entry.value("id", "") != session) continue;
    FlightFigures figures;
    figures.frames_in = entry.value("frames_in", 0);
    figures.frames_tracked = entry.value("frames_tracked", 0);
    figures.frames_in_main = entry.value("frames_in_main", 0);
    figures.frames_dropped = frontend.value("frames_dropped", int64_t{0});
    figures.num_parts = static_cast<int>(summary.value("components", OrderedJson::array()).size());
    figures.joins_a_map = sessions.size() > 1;
    const OrderedJson untracked = frontend.value("untracked", OrderedJson::object());
    for (const auto& [cause, count] : untracked.items()) figures.untracked[cause] = count.get<int>();
    return DescribeSmallMap(figures);
  }
  return "";
}

}  // namespace mapmend

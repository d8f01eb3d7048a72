#include "libs/stream/frames_read.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "libs/base/frame_ranges.h"

namespace mapmend {
namespace {

// Settings may be of another program, and wrong in any way: then nothing is left out.
std::set<int> SkippedFrames(const nlohmann::json& settings) {
  const auto skipped = settings.find("skip_frames");
  if (skipped == settings.end() || !skipped->is_string()) return {};
  try {
    return ParseFrameRanges(skipped->get<std::string>());
  } catch (const std::runtime_error&) {
    return {};
  }
}

double NumberOr(const nlohmann::json& settings, const char* name, double otherwise) {
  const auto value = settings.find(name);
  return value != settings.end() && value->is_number() ? value->get<double>() : otherwise;
}

}  // namespace

int CountFramesRead(const SessionStarted& start, int first_frame, int last_frame) {
  if (last_frame < 0) return 0;
  const nlohmann::json settings = nlohmann::json::parse(start.settings_json, nullptr, false);
  if (!settings.is_object()) return last_frame + 1;
  // Which frame lies --start seconds behind the first one is not told, but frames are seldom long without a pose then.
  double begin = std::max(0.0, NumberOr(settings, "first_frame", 0));
  if (NumberOr(settings, "start_s", 0) > 0) begin = std::max(begin, static_cast<double>(first_frame));
  const auto every = std::max<int64_t>(1, static_cast<int64_t>(std::min(1e9, NumberOr(settings, "every", 1))));
  const std::set<int> skipped = SkippedFrames(settings);
  int count = 0;
  for (auto i = static_cast<int64_t>(std::min(begin, 1e9)); i <= last_frame; ++i) {
    count += i % every == 0 && !skipped.contains(static_cast<int>(i));
  }
  return count;
}

}  // namespace mapmend

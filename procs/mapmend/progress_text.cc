#include "procs/mapmend/progress_text.h"

#include <algorithm>
#include <cstdio>

#include "libs/base/event_log.h"
#include "libs/base/plural.h"
#include "procs/mapmend/progress.h"

namespace mapmend {
namespace {

std::string OneDecimal(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f", value);
  return text;
}

}  // namespace

std::string DescribeFlight(const FlightProgress& p) {
  const auto frames = static_cast<int64_t>(p.frames), total = static_cast<int64_t>(p.frames_total);
  std::string text = total > 0 ? std::to_string(frames) + "/" + Plural(total, "frame") : Plural(frames, "frame");
  const double left = p.frames_total - p.frames - static_cast<double>(p.dropped);
  if (left > 0 && p.fps > 0) {
    text += ", " + FormatDuration(left / p.fps) + " left";
    if (p.merging_s >= 1) text += " and about " + FormatDuration(p.merging_s) + " of merging";
  }
  if (p.lost_frame) {
    text += ", lost after frame " + std::to_string(*p.lost_frame) + " (" + FormatUtime(p.lost_utime) + ")";
    if (p.found_frame) text += ", again from " + std::to_string(*p.found_frame);
  }
  text += ", " + Plural(p.submaps, "submap") + ", " + Plural(p.connections, "connection");
  if (p.dropped > 0) text += ", " + std::to_string(p.dropped) + " dropped";
  if (p.refused > 0) text += ", " + std::to_string(p.refused) + " refused";
  if (p.frames > 0) text += ", " + OneDecimal(p.fps) + " frames/s";
  return text;
}

std::string DescribeMerging(int connections, int in_use, int parts, double estimate_s, double elapsed_s) {
  const double left = estimate_s - elapsed_s;
  return "merging, " +
         (left >= 1 ? "about " + FormatDuration(left) + " left" : "for " + FormatDuration(elapsed_s) + " so far") +
         ": " + Plural(connections, "connection") + ", " + std::to_string(in_use) + " in use, " + Plural(parts, "part");
}

}  // namespace mapmend

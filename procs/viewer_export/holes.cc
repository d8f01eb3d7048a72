#include "procs/viewer_export/holes.h"

#include <algorithm>
#include <cstdio>
#include <limits>

namespace mapmend {
namespace {

std::string DescribeHole(const MapHole& hole) {
  const int n = hole.num_frames;
  char text[160];
  if (hole.last_frame < 0) {
    std::snprintf(text, sizeof(text), "frame %d to the end (%.1f s)", hole.first_frame,
                  1e-6 * static_cast<double>(hole.duration_us));
    return text;
  }
  int size =
      n == 1 ? std::snprintf(text, sizeof(text), "frame %d (1 frame", hole.first_frame)
             : std::snprintf(text, sizeof(text), "frames %d to %d (%d frames", hole.first_frame, hole.last_frame, n);
  const double seconds = 1e-6 * static_cast<double>(hole.duration_us);
  if (seconds > 0) {
    size +=
        std::snprintf(text + size, sizeof(text) - static_cast<size_t>(size), ", %.*f s", seconds < 10 ? 1 : 0, seconds);
  }
  return std::string(text, static_cast<size_t>(size)) + ")";
}

// What is missing among the first components.
std::vector<MapHole> FindAmong(const Snapshot& snapshot, size_t num_components) {
  std::vector<MapHole> holes;
  if (snapshot.components.empty()) return holes;
  const std::vector<std::string>& sessions = snapshot.model->SessionOrder();
  for (int s = 0; s < static_cast<int>(sessions.size()); ++s) {
    const Session& session = snapshot.model->GetSession(sessions[s]);
    std::vector<MergedFrame> frames;
    for (size_t c = 0; c < num_components; ++c) {
      for (const MergedFrame& frame : snapshot.components[c].frames) {
        if (frame.session == s) frames.push_back(frame);
      }
    }
    if (frames.size() < 2) continue;  // a flight that is not in the main map at all is no hole in it
    std::sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
    const auto is_same = [](const auto& a, const auto& b) { return a.frame == b.frame; };
    frames.erase(std::unique(frames.begin(), frames.end(), is_same), frames.end());
    // Where only every so manyth frame was mapped, those in between are not lacking.
    int step = std::numeric_limits<int>::max();
    for (size_t i = 1; i < frames.size(); ++i) step = std::min(step, frames[i].frame - frames[i - 1].frame);
    const auto add = [&](int before, int after, int64_t duration_us) {
      const int num_frames = (after - before - 1) / step;
      if (num_frames > 0) holes.push_back({s, before + step, before + step * num_frames, num_frames, duration_us});
    };
    // A first frame that is later than the flight's start; frames that were left out there do not count.
    if (frames.front().utime > session.start_utime)
      add(-step, frames.front().frame, frames.front().utime - session.start_utime);
    for (size_t i = 1; i < frames.size(); ++i)
      add(frames[i - 1].frame, frames[i].frame, frames[i].utime - frames[i - 1].utime);
    if (const int64_t end = snapshot.model->LastUtime(sessions[s]); session.ended && end > frames.back().utime)
      holes.push_back({s, frames.back().frame + step, -1, 0, end - frames.back().utime});
  }
  return holes;
}

}  // namespace

std::vector<MapHole> FindHoles(const Snapshot& snapshot) { return FindAmong(snapshot, 1); }

std::vector<MapHole> FindHolesOfAll(const Snapshot& snapshot) {
  return FindAmong(snapshot, snapshot.components.size());
}

std::string DescribeHoles(const std::vector<MapHole>& holes) {
  if (holes.empty()) return "no holes";
  if (holes.size() == 1) return "1 hole: " + DescribeHole(holes[0]);
  const MapHole& longest = *std::max_element(
      holes.begin(), holes.end(), [](const MapHole& a, const MapHole& b) { return a.duration_us < b.duration_us; });
  return std::to_string(holes.size()) + " holes; the longest: " + DescribeHole(longest);
}

}  // namespace mapmend

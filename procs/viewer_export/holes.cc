#include "procs/viewer_export/holes.h"

#include <algorithm>
#include <cstdio>

namespace mapmend {
namespace {

std::string DescribeHole(const MapHole& hole) {
  const int n = hole.NumFrames();
  char text[160];
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

}  // namespace

std::vector<MapHole> FindHoles(const Snapshot& snapshot) {
  std::vector<MapHole> holes;
  if (snapshot.components.empty()) return holes;
  const std::vector<std::string>& sessions = snapshot.model->SessionOrder();
  for (int s = 0; s < static_cast<int>(sessions.size()); ++s) {
    const Session& session = snapshot.model->GetSession(sessions[s]);
    std::vector<MergedFrame> frames;
    for (const MergedFrame& frame : snapshot.components[0].frames) {
      if (frame.session == s) frames.push_back(frame);
    }
    if (frames.empty()) continue;  // a flight that is not in the main map at all is no hole in it
    std::sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
    // A first frame that is later than the flight's start; frames that were left out there do not count.
    if (frames.front().frame > 0 && frames.front().utime > session.start_utime)
      holes.push_back({s, 0, frames.front().frame - 1, frames.front().utime - session.start_utime});
    for (size_t i = 1; i < frames.size(); ++i) {
      if (frames[i].frame > frames[i - 1].frame + 1) {
        holes.push_back({s, frames[i - 1].frame + 1, frames[i].frame - 1, frames[i].utime - frames[i - 1].utime});
      }
    }
    if (frames.back().frame + 1 < session.info.num_frames)
      holes.push_back({s, frames.back().frame + 1, session.info.num_frames - 1, 0});
  }
  return holes;
}

std::string DescribeHoles(const std::vector<MapHole>& holes) {
  if (holes.empty()) return "no holes";
  if (holes.size() == 1) return "1 hole: " + DescribeHole(holes[0]);
  int num_frames = 0;
  for (const MapHole& hole : holes) num_frames += hole.NumFrames();
  const MapHole& longest = *std::max_element(
      holes.begin(), holes.end(), [](const MapHole& a, const MapHole& b) { return a.NumFrames() < b.NumFrames(); });
  return std::to_string(holes.size()) + " holes, " + std::to_string(num_frames) +
         " frames in all; the longest: " + DescribeHole(longest);
}

}  // namespace mapmend

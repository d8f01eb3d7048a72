#include "libs/merging/seam_windows.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace mapmend {

std::vector<std::vector<int>> ChooseSeamWindows(const MergedMap& map, const SeamWindowOptions& options) {
  const int n = static_cast<int>(map.keyframes.size());
  std::vector<int> at_seam(n, 0);  // fused points that a keyframe sees
  std::vector<std::map<int, int>> shared(n);
  for (const MergedPoint& point : map.points) {
    const Track& track = point.track;
    for (const TrackElement& e : track) {
      at_seam[e.keyframe] += !point.fused.empty();
      for (const TrackElement& f : track) {
        if (e.keyframe != f.keyframe) ++shared[e.keyframe][f.keyframe];
      }
    }
  }
  std::vector<int> order;
  for (int k = 0; k < n; ++k) {
    if (at_seam[k] > 0) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](int l, int r) { return at_seam[l] > at_seam[r]; });

  std::vector<char> is_covered(n, 0);
  std::vector<std::vector<int>> windows;
  for (const int start : order) {
    if (is_covered[start]) continue;
    if (static_cast<int>(windows.size()) >= options.max_windows) break;
    std::set<int> window;
    // Keyframes next to the window by what the one that reached them shares with them; ties: lower index.
    std::set<std::pair<int, int>> open = {{0, start}};
    while (!open.empty() && static_cast<int>(window.size()) < options.window_size) {
      const int k = open.begin()->second;
      open.erase(open.begin());
      if (is_covered[k]) continue;
      window.insert(k);
      is_covered[k] = 1;
      for (const auto& [other, count] : shared[k]) {
        if (at_seam[other] > 0 && !is_covered[other]) open.insert({-count, other});
      }
    }
    windows.emplace_back(window.begin(), window.end());
  }
  return windows;
}

}  // namespace mapmend

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

#include "libs/connecting/wide_registration.h"

namespace mapmend {
namespace {

// Evenly chosen, both ends among them.
std::vector<int> SpreadFrames(const WideSide& side, int count) {
  const int n = static_cast<int>(side.frames.size());
  std::vector<int> chosen;
  for (int i = 0; i < std::min(n, count); ++i) {
    chosen.push_back(n <= count || count == 1 ? i : static_cast<int>((static_cast<long>(i) * (n - 1)) / (count - 1)));
  }
  return chosen;
}

}  // namespace

std::vector<WideTrackMatch> MatchWideSides(const WideSide& a, const WideSide& b,
                                           const WideRegistrationOptions& options) {
  std::map<std::pair<int, int>, WideTrackMatch> votes;
  for (const int i : SpreadFrames(a, options.max_matched_frames)) {
    for (const int j : SpreadFrames(b, options.max_matched_frames)) {
      for (const WideMatch& m : MatchWide(*a.frames[i].features, *b.frames[j].features, options.matching)) {
        WideTrackMatch& match = votes[{a.track_of[i][m.a], b.track_of[j][m.b]}];
        if (match.num_votes++ == 0 || m.squared_distance < match.squared_distance)
          match.squared_distance = m.squared_distance;
      }
    }
  }
  std::vector<WideTrackMatch> all;
  for (auto& [tracks, match] : votes) {
    std::tie(match.track_a, match.track_b) = tracks;
    all.push_back(match);
  }
  std::stable_sort(all.begin(), all.end(), [](const WideTrackMatch& l, const WideTrackMatch& r) {
    return l.num_votes != r.num_votes ? l.num_votes > r.num_votes : l.squared_distance < r.squared_distance;
  });
  std::vector<char> used_a(a.tracks.size(), 0), used_b(b.tracks.size(), 0);
  std::erase_if(all, [&](const WideTrackMatch& m) {
    if (used_a[m.track_a] || used_b[m.track_b]) return true;
    used_a[m.track_a] = used_b[m.track_b] = 1;
    return false;
  });
  return all;
}

}  // namespace mapmend

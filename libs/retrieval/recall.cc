#include "libs/retrieval/recall.h"

#include <algorithm>
#include <cstdlib>

namespace mapmend {

RecallResult MeasureRecall(const std::vector<RecallFrame>& frames, const RecallOptions& options) {
  RecallResult result;
  int found_at_1 = 0, found_at_3 = 0, found_at_10 = 0;
  const int num_frames = static_cast<int>(frames.size());
  for (int i = 0; i < num_frames; ++i) {
    const auto is_same_place = [&](int j) {
      return (frames[j].position - frames[i].position).norm() <= options.radius;
    };
    std::vector<std::pair<double, int>> ranked;  // minus score, frame
    bool has_match = false;
    for (int j = 0; j < num_frames; ++j) {
      if (std::abs(j - i) <= options.excluded_frames) continue;
      ranked.emplace_back(-BowScore(frames[i].bow, frames[j].bow), j);
      has_match = has_match || is_same_place(j);
    }
    if (!has_match) continue;
    ++result.num_queries;
    std::sort(ranked.begin(), ranked.end());
    const auto first =
        std::find_if(ranked.begin(), ranked.end(), [&](const auto& r) { return is_same_place(r.second); });
    const auto rank = first - ranked.begin();
    found_at_1 += rank < 1;
    found_at_3 += rank < 3;
    found_at_10 += rank < 10;
  }
  if (result.num_queries > 0) {
    result.recall_at_1 = static_cast<double>(found_at_1) / result.num_queries;
    result.recall_at_3 = static_cast<double>(found_at_3) / result.num_queries;
    result.recall_at_10 = static_cast<double>(found_at_10) / result.num_queries;
  }
  return result;
}

}  // namespace mapmend

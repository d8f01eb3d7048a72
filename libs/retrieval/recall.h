#pragma once

#include <Eigen/Core>
#include <vector>

#include "libs/base/range.h"
#include "libs/retrieval/bow_vector.h"

namespace mapmend {

struct RecallFrame {
  Eigen::Vector3d position;  // of the camera, metres
  BowVector bow;
};

struct RecallOptions {
  double radius = 60;        // metres: camera distance that counts as the same place
  int excluded_frames = 10;  // before and after the query: they are alike without being a return

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("radius", radius, AtLeast(0), "m");
    v("excluded_frames", excluded_frames, Range(0, 1e6), "frames");
  }
};

// Of the queries that have a frame within the radius, the share with such a frame among the first 1, 3, 10 by BoW score
// (ties: lower frame index).
struct RecallResult {
  int num_queries = 0;
  double recall_at_1 = 0, recall_at_3 = 0, recall_at_10 = 0;
};

// Queries with every frame against all others but its neighbours in time.
RecallResult MeasureRecall(const std::vector<RecallFrame>& frames, const RecallOptions& options);

}  // namespace mapmend

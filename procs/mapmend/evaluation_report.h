#pragma once

#include <string>
#include <vector>

#include "libs/drawing/top_view.h"
#include "libs/geometry/alignment.h"

// What `mapmend eval` says about trajectories against ground truth: a table, JSON and a picture.
namespace mapmend {

struct EvaluatedTrajectory {
  std::string file;
  Trajectory trajectory;
  Evaluation evaluation;
};

// One line each, with a head; a trajectory that could not be aligned has the reason instead of figures. With several
// trajectories a last line names the largest error of all.
std::string FormatEvaluationTable(const std::vector<EvaluatedTrajectory>& evaluated);

// {groundtruth, alignment, tolerance_s, trajectories[] {file, success, reason, poses, pairs, coverage, rmse_m, mean_m,
// median_m, max_m, max_at_s, reference_from_estimate {scale, translation, quaternion_xyzw}}}
std::string FormatEvaluationJson(const std::vector<EvaluatedTrajectory>& evaluated,
                                 const std::string& ground_truth_file, const EvaluationOptions& options);

// Ground truth and every aligned trajectory from above; thin lines join what belongs together in time.
TopView MakeEvaluationView(const std::vector<EvaluatedTrajectory>& evaluated, const Trajectory& ground_truth);

}  // namespace mapmend

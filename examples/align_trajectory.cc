// Reads a trajectory and a reference (formats: docs/operating_guide.md), finds the similarity that lays the one on the
// other, and prints the error that is left.
//     align_trajectory ESTIMATE REFERENCE

#include <cstdio>
#include <exception>

#include "mapmend/geometry/alignment.h"
#include "mapmend/geometry/read_trajectory.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: align_trajectory ESTIMATE REFERENCE\n");
    return 2;
  }
  try {
    const mapmend::Trajectory estimate = mapmend::ReadTrajectoryFile(argv[1]).poses;
    const mapmend::Trajectory reference = mapmend::ReadTrajectoryFile(argv[2]).poses;
    const mapmend::Evaluation found = mapmend::EvaluateTrajectory(estimate, reference, mapmend::EvaluationOptions());
    if (!found.success) throw std::runtime_error(found.reason);
    std::printf("%zu of %zu poses, scale %.3f, RMSE %.3f m\n", found.pairs.size(), estimate.size(),
                found.reference_from_estimate.scale, found.rmse);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "align_trajectory: %s\n", e.what());
    return 1;
  }
}

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/similarity3.h"
#include "libs/geometry/trajectory_file.h"

// How well an estimated trajectory agrees with a reference: association by time, least-squares alignment, absolute
// trajectory error (ATE; Sturm et al., IROS 2012).
namespace mapmend {

enum class AlignmentKind { kSimilarity, kRigid };

struct PointAlignment {
  bool success = false;
  std::string reason;  // why not, one sentence
  // The points lie on one line: the rotation about it is arbitrary (distances after alignment are still right).
  bool collinear = false;
  Similarity3 to_from_source;  // scale is 1 for kRigid
};

// Least-squares transform minimising sum |to_i - T source_i|^2 (Umeyama, PAMI 1991). Vectors of equal length, at least
// 3; kSimilarity also needs points that are not all the same.
PointAlignment AlignPoints(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& to,
                           AlignmentKind kind);

struct TimePair {
  size_t estimate = 0, reference = 0;  // indices
};

// Pairs poses whose times differ by at most tolerance_us; closest pairs first, each pose used once. Ascending by
// estimate index. The trajectories need not be sorted.
std::vector<TimePair> AssociateByTime(const Trajectory& estimate, const Trajectory& reference, int64_t tolerance_us);

struct EvaluationOptions {
  AlignmentKind kind = AlignmentKind::kSimilarity;
  int64_t tolerance_us = 10000;  // 10 ms, a third of a frame at 30 fps

  // Not visited: kind: whoever compares says it.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("tolerance_us", tolerance_us, Range(0, 1e15), "us");
  }
};

// Errors are distances between camera centres after alignment, in the reference's unit (metres).
struct Evaluation {
  bool success = false;
  std::string reason;
  bool collinear = false;
  Similarity3 reference_from_estimate;
  size_t num_estimate = 0, num_reference = 0;
  std::vector<TimePair> pairs;
  std::vector<double> errors;  // per pair
  double rmse = 0, mean = 0, median = 0, max = 0;
  int64_t max_utime = 0;  // of the reference pose where the error is largest
  double coverage = 0;    // pairs / reference poses
};

Evaluation EvaluateTrajectory(const Trajectory& estimate, const Trajectory& reference,
                              const EvaluationOptions& options);

}  // namespace mapmend

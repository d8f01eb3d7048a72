#pragma once

namespace mapmend {

// Connection strength between two submaps (paper §3.4, eq. 3). Higher is stronger.
//   num_connected_frames  F, verified pairs of connected frames
//   num_common_points     M, distinct map points common to those frames
//   median_angle_deg      theta, median intersection angle; clamped at 45 degrees (§3.4), where it would drown F and M
// C = F + 0.1 M + 0.1 theta^2
double ConnectionStrength(int num_connected_frames, int num_common_points, double median_angle_deg);

inline constexpr double kMaxUsefulAngleDeg = 45;

}  // namespace mapmend

#include "libs/connecting/connection_strength.h"

#include <algorithm>

namespace mapmend {

double ConnectionStrength(int num_connected_frames, int num_common_points, double median_angle_deg) {
  const double theta = std::clamp(median_angle_deg, 0.0, kMaxUsefulAngleDeg);
  return num_connected_frames + 0.1 * num_common_points + 0.1 * theta * theta;
}

}  // namespace mapmend

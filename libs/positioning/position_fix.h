#pragma once

#include <cstdint>
#include <limits>
#include <string>

namespace mapmend {

// Where a receiver says that the vehicle was. NaN: not told.
struct PositionFix {
  static constexpr double kNotTold = std::numeric_limits<double>::quiet_NaN();

  int64_t utime = 0;                           // of the receiver's clock
  double latitude_deg = 0, longitude_deg = 0;  // WGS 84
  double altitude_m = kNotTold;                // above whatever the receiver counts from; the same for all fixes
  double sigma_horizontal_m = kNotTold, sigma_vertical_m = kNotTold;  // standard deviations
  // How the camera was held, as gimbals tell it: yaw clockwise from north, pitch from the horizon upwards (straight
  // down is -90), roll to the right.
  double yaw_deg = kNotTold, pitch_deg = kNotTold, roll_deg = kNotTold;

  bool HasAltitude() const { return altitude_m == altitude_m; }
  bool HasAngles() const { return yaw_deg == yaw_deg && pitch_deg == pitch_deg && roll_deg == roll_deg; }
};

// Why a fix cannot be used, whatever the others say; empty if it can.
std::string ProblemOf(const PositionFix& fix);

// Metres between two fixes along the ground, good to a percent; for plausibility.
double GroundDistance(const PositionFix& a, const PositionFix& b);

// Looks at fixes in the order in which they come: one whose time does not grow, or that no vehicle can have reached, is
// refused. Where several in a row agree with each other and not with what was taken before, they are taken.
class FixFilter {
 public:
  // Empty if the fix is taken, else why not, for a person.
  std::string Add(const PositionFix& fix);

 private:
  PositionFix last_, stray_;
  bool has_last_ = false;
  int num_strays_ = 0;  // in a row, agreeing with each other
};

}  // namespace mapmend

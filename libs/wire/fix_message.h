#pragma once

#include <mapmend/gps_fix_t.hpp>

#include "libs/positioning/position_fix.h"

// Between the message and the plain type, for the codecs of this library; nobody else includes it. Nothing is checked.
namespace mapmend::wire {

inline PositionFix ReadFix(const gps_fix_t& m) {
  PositionFix fix;
  fix.utime = m.utime;
  fix.latitude_deg = m.latitude_deg;
  fix.longitude_deg = m.longitude_deg;
  fix.altitude_m = m.altitude_m;
  fix.sigma_horizontal_m = m.sigma_horizontal_m;
  fix.sigma_vertical_m = m.sigma_vertical_m;
  fix.yaw_deg = m.yaw_deg;
  fix.pitch_deg = m.pitch_deg;
  fix.roll_deg = m.roll_deg;
  return fix;
}

inline gps_fix_t WriteFix(const PositionFix& fix) {
  gps_fix_t m{};
  m.utime = fix.utime;
  m.latitude_deg = fix.latitude_deg;
  m.longitude_deg = fix.longitude_deg;
  m.altitude_m = fix.altitude_m;
  m.sigma_horizontal_m = fix.sigma_horizontal_m;
  m.sigma_vertical_m = fix.sigma_vertical_m;
  m.yaw_deg = fix.yaw_deg;
  m.pitch_deg = fix.pitch_deg;
  m.roll_deg = fix.roll_deg;
  return m;
}

}  // namespace mapmend::wire

#include "libs/positioning/position_fix.h"

#include <cmath>

#include "libs/base/degree.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

constexpr double kMetresPerDegree = 111319.5;
constexpr double kMaxSpeed = 150, kSlack = 30;  // m/s; m: faster than what carries cameras, and what receivers waver
constexpr int kAgreeing = 3;                    // strays in a row that are believed after all

bool CanBeReached(const PositionFix& from, const PositionFix& to) {
  const double seconds = 1e-6 * std::abs(static_cast<double>(to.utime - from.utime));
  return GroundDistance(from, to) <= kMaxSpeed * seconds + kSlack;
}

bool IsSigma(double sigma) { return std::isnan(sigma) || (sigma >= 0 && sigma < 1e5); }

}  // namespace

std::string ProblemOf(const PositionFix& fix) {
  if (!std::isfinite(fix.latitude_deg) || !std::isfinite(fix.longitude_deg)) return "no position";
  if (std::abs(fix.latitude_deg) > 90 || std::abs(fix.longitude_deg) > 360)
    return Format("latitude %g, longitude %g: not on the earth", fix.latitude_deg, fix.longitude_deg);
  if (fix.latitude_deg == 0 && fix.longitude_deg == 0) return "latitude 0, longitude 0: the receiver had no fix";
  if (std::isinf(fix.altitude_m) || std::abs(fix.altitude_m) > 1e5)
    return Format("altitude %g m: out of range", fix.altitude_m);
  if (!IsSigma(fix.sigma_horizontal_m) || !IsSigma(fix.sigma_vertical_m)) return "standard deviation is out of range";
  return "";
}

double GroundDistance(const PositionFix& a, const PositionFix& b) {
  double east = std::remainder(b.longitude_deg - a.longitude_deg, 360);
  east *= std::cos(0.5 * (a.latitude_deg + b.latitude_deg) * kDegree);
  return kMetresPerDegree * std::hypot(east, b.latitude_deg - a.latitude_deg);
}

std::string FixFilter::Add(const PositionFix& fix) {
  if (std::string problem = ProblemOf(fix); !problem.empty()) return problem;
  if (has_last_ && fix.utime <= last_.utime) return "its time is not later than that of the fix before";
  if (has_last_ && !CanBeReached(last_, fix)) {
    num_strays_ = num_strays_ > 0 && fix.utime > stray_.utime && CanBeReached(stray_, fix) ? num_strays_ + 1 : 1;
    stray_ = fix;
    if (num_strays_ < kAgreeing) {
      return Format("a jump of %.0f m in %.1f s", GroundDistance(last_, fix),
                    1e-6 * static_cast<double>(fix.utime - last_.utime));
    }
  }
  num_strays_ = 0;
  last_ = fix;
  has_last_ = true;
  return "";
}

}  // namespace mapmend

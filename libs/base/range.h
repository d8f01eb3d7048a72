#pragma once

#include <limits>
#include <string>

namespace mapmend {

// What a number may be. Not a number lies in no range.
struct Range {
  // From lowest to highest, both included.
  constexpr Range(double lowest, double highest) : lo(lowest), hi(highest) {}

  constexpr bool Contains(double x) const {
    return (is_open_below ? x > lo : x >= lo) && (is_open_above ? x < hi : x <= hi);
  }
  // For a person: "0 to 1", "at least 1", "more than 0, less than 1", "any".
  std::string Describe() const;

  double lo, hi;
  bool is_open_below = false, is_open_above = false;  // lo and hi themselves are excluded
};

// From lo on.
constexpr Range AtLeast(double lo) { return {lo, std::numeric_limits<double>::infinity()}; }

// Everything beyond lo.
constexpr Range MoreThan(double lo) {
  Range range = AtLeast(lo);
  range.is_open_below = true;
  return range;
}

// Between the two, both excluded.
constexpr Range Between(double lo, double hi) {
  Range range(lo, hi);
  range.is_open_below = range.is_open_above = true;
  return range;
}

}  // namespace mapmend

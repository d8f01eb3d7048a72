#pragma once

#include <algorithm>
#include <vector>

namespace mapmend {

// The upper one of the two middle values if there are two; 0 without any.
inline double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace mapmend

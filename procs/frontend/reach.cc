#include "procs/frontend/reach.h"

#include <cstdlib>
#include <iterator>
#include <map>
#include <vector>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr size_t kMinKeyframes = 3;

double Speed(int64_t utime, const Eigen::Vector3d& center, const std::pair<const int64_t, Eigen::Vector3d>& other) {
  return (center - other.second).norm() / static_cast<double>(std::abs(utime - other.first));
}

}  // namespace

bool IsWithinReach(const WorkingMap& map, int64_t utime, const Eigen::Vector3d& center, double max_factor) {
  std::map<int64_t, Eigen::Vector3d> places;  // by time
  for (const WorkingKeyframe& k : map.Keyframes()) {
    if (!k.removed && k.frame->utime != utime) places[k.frame->utime] = k.cam_from_submap.Center();
  }
  if (places.size() < kMinKeyframes) return true;
  std::vector<double> speeds;
  for (auto place = std::next(places.begin()); place != places.end(); ++place)
    speeds.push_back(Speed(place->first, place->second, *std::prev(place)));
  const double limit = max_factor * Median(std::move(speeds));
  const auto after = places.lower_bound(utime);
  if (after != places.end() && Speed(utime, center, *after) > limit) return false;
  return after == places.begin() || Speed(utime, center, *std::prev(after)) <= limit;
}

}  // namespace mapmend

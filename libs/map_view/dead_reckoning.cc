#include "libs/map_view/dead_reckoning.h"

#include <map>
#include <utility>

#include "libs/base/rounded.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

std::vector<PathPose> PathOf(const SnapshotSubmap& submap) {
  std::vector<PathPose> path;
  for (const MergedFrame& frame : submap.frames) {
    const double seconds = 1e-6 * static_cast<double>(frame.utime);
    if (path.empty() || seconds > path.back().seconds) path.push_back({seconds, frame.cam_from_root.Inverse()});
  }
  return path;
}

}  // namespace

std::vector<LikelyPlace> FindLikelyPlaces(const Snapshot& snapshot) {
  // By the time at which they begin: a submap may hold frames from before another one that it was joined to.
  std::map<std::pair<int, int64_t>, int> submaps;  // (session, time)
  for (int i = 0; i < static_cast<int>(snapshot.submaps.size()); ++i) {
    const SnapshotSubmap& submap = snapshot.submaps[i];
    if (!submap.frames.empty()) submaps[{submap.session, submap.frames.front().utime}] = i;
  }
  std::vector<LikelyPlace> places;
  const SnapshotSubmap* earlier = nullptr;
  for (const auto& [key, index] : submaps) {
    const SnapshotSubmap& later = snapshot.submaps[index];
    if (earlier != nullptr && earlier->session == later.session && earlier->component != later.component) {
      const MergedFrame &last = earlier->frames.back(), &first = later.frames.front();
      const BridgedGap gap = BridgeGap(PathOf(*earlier), PathOf(later));
      const Similarity3 scaled(gap.scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
      const Similarity3 earlier_from_later =
          Similarity3(last.cam_from_root.Inverse() * gap.before_from_after) * scaled * Similarity3(first.cam_from_root);
      if (gap.success)
        places.push_back({snapshot.FindSubmap(earlier->key), index, last.frame, first.frame, gap, earlier_from_later});
    }
    earlier = &later;
  }
  return places;
}

std::string DescribeLikelyPlace(const LikelyPlace& place, const Snapshot& snapshot) {
  const std::string& unit = snapshot.components[snapshot.submaps[place.earlier].component].frame.unit;
  const double distance = place.gap.before_from_after.translation.norm();
  return Format("if the camera went on as before and behind it, frame %d was ", place.first_frame) + Rounded(distance) +
         " (± " + Rounded(place.gap.sigma_position) + ") " + unit + Format(" from frame %d", place.last_frame);
}

}  // namespace mapmend

#pragma once

#include <optional>
#include <vector>

#include "libs/positioning/placement.h"

// Which frames and fixes belong together; part of placement.
namespace mapmend {

// Pairs of one part of the map and the fixes of one flight, whose clock is `offset_us` behind the camera's. Of frames
// and fixes, what comes less often is paired with what lies between two neighbours of the other; nothing is made up
// across gaps.
//   enus  of the fixes
std::vector<PositionPair> MatchPositions(const std::vector<TrackPoint>& track, int session, const SessionFixes& fixes,
                                         const std::vector<Eigen::Vector3d>& enus, int64_t offset_us,
                                         const PlacementOptions& options);

// Where the receiver was at a frame; nullopt if no fix is near it in time.
std::optional<PositionPair> PositionAt(const TrackPoint& frame, const SessionFixes& fixes,
                                       const std::vector<Eigen::Vector3d>& enus, int64_t offset_us,
                                       const PlacementOptions& options);

// The offset between the clocks of camera and receiver, from all parts of the map that the flight is in.
ClockOffset EstimateClockOffset(const std::vector<std::vector<TrackPoint>>& components, int session,
                                const SessionFixes& fixes, const std::vector<Eigen::Vector3d>& enus,
                                const PlacementOptions& options);

}  // namespace mapmend

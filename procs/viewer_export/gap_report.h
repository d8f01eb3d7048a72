#pragma once

#include <optional>
#include <string>
#include <vector>

#include "libs/map_view/world.h"
#include "procs/viewer_export/coverage.h"

namespace mapmend {

// One thing to fly again.
struct Gap {
  enum class Kind {
    kStretch,     // frames of a flight that no part of the map holds
    kConnection,  // two parts that nothing joins
    kGround,      // ground that no image, or too few, see
  };
  Kind kind = Kind::kStretch;
  std::string text;                                   // for a person, one sentence without full stop
  int session = 0, first_frame = 0, last_frame = -1;  // kStretch; last_frame -1: up to the end of the flight
  double seconds = 0;                                 // kStretch
  int component_a = 0, component_b = 0;               // kConnection
  // kStretch: where the camera was meanwhile; kConnection: the line to be flown. Level frame of the report; empty: it
  // is not known where that is.
  std::vector<Eigen::Vector3d> line;
  double length = 0;      // of it
  CoverageRegion region;  // kGround
};

// How the flight was flown, so that what is flown again fits.
struct FlightStyle {
  double height = 0;                                 // above the ground
  double speed = 0;                                  // per second; 0: not known
  double heading_deg = 0;                            // of the strips, 0 to 180 clockwise from the y axis (north)
  double pitch_deg = -90;                            // of the camera, straight down -90
  double forward_overlap = 0;                        // of neighbouring keyframes
  double footprint_length = 0, footprint_width = 0;  // along and across the flight
};

struct GapReport {
  bool is_placed = false;  // lengths are metres, x east, y north, z up; else the units of the main map, z up
  bool has_ground = false;
  Rigid3 level_from_world;
  std::vector<int> components;        // that it looks at: the placed ones, or the main map
  std::vector<Footprint> footprints;  // of these
  Coverage coverage;
  FlightStyle style;
  std::vector<Gap> gaps;

  const char* Unit() const { return is_placed ? "m" : "map units"; }
};

// What to fly again. placed: the snapshot after PlaceOnEarth in "enu"; world: null without positions.
GapReport FindGaps(const Snapshot& placed, const WorldPlacement* world, const CoverageOptions& options);

}  // namespace mapmend

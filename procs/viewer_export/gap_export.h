#pragma once

#include <string>

#include "procs/viewer_export/gap_report.h"

namespace mapmend {

// What is to be flown again, for maps, for geographic information systems and for autopilots. All but the picture and
// the JSON need a report that is placed on the earth.

// RFC 7946. Lines of stretches and connections, polygons of ground.
std::string MakeGapsGeoJson(const GapReport& report, const WorldPlacement& world);
// A folder of KML, to stand in a document.
std::string MakeGapsKmlFolder(const GapReport& report, const WorldPlacement& world);
std::string MakeGapsKml(const GapReport& report, const WorldPlacement& world);

// The way over all gaps, one after the other: lines along stretches and connections, strips over ground, with the
// height, heading and overlap of the flight.
struct PlannedPoint {
  Eigen::Vector3d enu = Eigen::Vector3d::Zero();  // on the ground plane of the report; z is not used
  bool begins_line = false, ends_line = false;    // images are taken between the two
};
std::vector<PlannedPoint> PlanWay(const GapReport& report);

// QGroundControl's plan file (format version 1; docs.qgroundcontrol.com, "Plan File Format"): heights above the place
// of take-off, which is taken to be as high as the ground.
std::string MakeQgcPlan(const GapReport& report, const WorldPlacement& world);
// The same as MAVLink waypoints ("QGC WPL 110").
std::string MakeWaypoints(const GapReport& report, const WorldPlacement& world);

// The surveyed ground by the number of keyframes that see it, paths, and what is to be flown again. Empty without
// ground.
std::string MakeGapsSvg(const Snapshot& placed, const GapReport& report);

// The figures for summary.json ("gaps", docs/exports.md) as text.
std::string MakeGapsJson(const GapReport& report);

}  // namespace mapmend

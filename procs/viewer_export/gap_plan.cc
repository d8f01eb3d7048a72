#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "libs/base/degree.h"
#include "libs/base/text_format.h"
#include "procs/viewer_export/gap_export.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

// MAVLink commands and the frame of heights above home (mavlink.io, common message set).
constexpr int kWaypoint = 16, kReturn = 20, kTakeoff = 22, kCameraTrigger = 206, kMountControl = 205;
constexpr int kRelativeAltitude = 3, kMissionFrame = 2;
constexpr double kSideOverlap = 0.6;

void AddLine(const std::vector<Eigen::Vector2d>& line, std::vector<PlannedPoint>* way) {
  for (size_t i = 0; i < line.size(); ++i)
    way->push_back({{line[i].x(), line[i].y(), 0}, i == 0, i + 1 == line.size()});
}

// Points of a path that matter: those in between are left out if they lie within the tolerance of the line (Douglas and
// Peucker 1973).
void Simplify(const std::vector<Eigen::Vector2d>& path, size_t first, size_t last, double tolerance,
              std::vector<Eigen::Vector2d>* kept) {
  size_t farthest = first;
  double most = tolerance;
  const Eigen::Vector2d along = path[last] - path[first];
  for (size_t i = first + 1; i < last; ++i) {
    const Eigen::Vector2d d = path[i] - path[first];
    const double share = along.squaredNorm() > 0 ? std::clamp(d.dot(along) / along.squaredNorm(), 0.0, 1.0) : 0;
    const double distance = (d - share * along).norm();
    if (distance <= most) continue;
    most = distance;
    farthest = i;
  }
  if (farthest == first) {
    kept->push_back(path[last]);
    return;
  }
  Simplify(path, first, farthest, tolerance, kept);
  Simplify(path, farthest, last, tolerance, kept);
}

// Strips along the flight's heading over a region, back and forth, half a footprint beyond it at both ends.
void AddStrips(const CoverageRegion& region, const FlightStyle& style, std::vector<PlannedPoint>* way) {
  const double heading = style.heading_deg * kDegree;
  const Eigen::Vector2d along(std::sin(heading), std::cos(heading)), across(std::cos(heading), -std::sin(heading));
  const double infinity = std::numeric_limits<double>::infinity();
  double low_a = infinity, high_a = -infinity, low_c = infinity, high_c = -infinity;
  for (const Eigen::Vector2d& p : region.rings[0]) {
    low_a = std::min(low_a, along.dot(p));
    high_a = std::max(high_a, along.dot(p));
    low_c = std::min(low_c, across.dot(p));
    high_c = std::max(high_c, across.dot(p));
  }
  // A camera that looks ahead sees what lies before it.
  const double ahead = style.pitch_deg < -10 ? style.height / std::tan(-style.pitch_deg * kDegree) : 0;
  const double spacing = std::max(1e-3, (1 - kSideOverlap) * style.footprint_width);
  const int num_strips = std::clamp(static_cast<int>(std::ceil((high_c - low_c) / spacing)), 1, 200);
  const double first = 0.5 * (low_c + high_c) - 0.5 * spacing * (num_strips - 1);
  const double beyond = 0.5 * style.footprint_length;
  for (int i = 0; i < num_strips; ++i) {
    const double c = first + spacing * i;
    const bool is_back = i % 2 == 1;
    Eigen::Vector2d begin = along * (low_a - beyond - ahead) + across * c;
    Eigen::Vector2d end = along * (high_a + beyond - ahead) + across * c;
    if (is_back) {
      begin += 2 * ahead * along;
      end += 2 * ahead * along;
      std::swap(begin, end);
    }
    AddLine({begin, end}, way);
  }
}

struct MissionItem {
  int command = 0, frame = kRelativeAltitude;
  double params[4] = {0, 0, 0, 0};
  Geodetic place;  // altitude above home
};

std::vector<MissionItem> MakeMission(const GapReport& report, const WorldPlacement& world) {
  std::vector<MissionItem> items;
  const std::vector<PlannedPoint> way = PlanWay(report);
  if (way.empty()) return items;
  const FlightStyle& style = report.style;
  const double spacing = std::max(0.5, (1 - style.forward_overlap) * style.footprint_length);
  const auto place = [&](const PlannedPoint& p) {
    Geodetic at = world.frame.ToGeodetic({p.enu.x(), p.enu.y(), 0});
    at.altitude_m = style.height;
    return at;
  };
  const auto add = [&](int command, int frame, std::initializer_list<double> params, const Geodetic& at) {
    MissionItem item;
    item.command = command;
    item.frame = frame;
    std::copy(params.begin(), params.end(), item.params);
    item.place = at;
    items.push_back(item);
  };
  add(kTakeoff, kRelativeAltitude, {}, place(way.front()));
  add(kMountControl, kMissionFrame, {style.pitch_deg}, {0, 0, 0});
  for (const PlannedPoint& p : way) {
    add(kWaypoint, kRelativeAltitude, {}, place(p));
    if (p.begins_line) add(kCameraTrigger, kMissionFrame, {spacing, 0, 1}, {0, 0, 0});
    if (p.ends_line) add(kCameraTrigger, kMissionFrame, {0}, {0, 0, 0});
  }
  add(kReturn, kMissionFrame, {}, {0, 0, 0});
  return items;
}

Geodetic HomeOf(const std::vector<MissionItem>& items, const GapReport& report, const WorldPlacement& world) {
  Geodetic home = items.front().place;
  // The ground below the cameras, as the receiver counts.
  double up = 0;
  for (const Footprint& footprint : report.footprints) up += footprint.corners[0].z();
  if (!report.footprints.empty()) up /= static_cast<double>(report.footprints.size());
  home.altitude_m = world.frame.origin().altitude_m + up;
  return home;
}

}  // namespace

std::vector<PlannedPoint> PlanWay(const GapReport& report) {
  std::vector<PlannedPoint> way;
  if (!report.is_placed || !report.has_ground) return way;
  for (const Gap& gap : report.gaps) {
    if (gap.kind == Gap::Kind::kGround) {
      AddStrips(gap.region, report.style, &way);
      continue;
    }
    if (gap.line.size() < 2) continue;
    std::vector<Eigen::Vector2d> path, kept;
    for (const Eigen::Vector3d& p : gap.line) path.emplace_back(p.x(), p.y());
    kept.push_back(path.front());
    Simplify(path, 0, path.size() - 1, 0.05 * report.style.footprint_width, &kept);
    AddLine(kept, &way);
  }
  return way;
}

std::string MakeQgcPlan(const GapReport& report, const WorldPlacement& world) {
  const std::vector<MissionItem> items = MakeMission(report, world);
  if (items.empty()) return "";
  const Geodetic home = HomeOf(items, report, world);
  OrderedJson list = OrderedJson::array();
  for (size_t i = 0; i < items.size(); ++i) {
    const MissionItem& item = items[i];
    const bool has_place = item.frame == kRelativeAltitude;
    OrderedJson params = {item.params[0],          item.params[1],           item.params[2],       item.params[3],
                          item.place.latitude_deg, item.place.longitude_deg, item.place.altitude_m};
    if (item.command == kMountControl) params[6] = 2;  // MAV_MOUNT_MODE_MAVLINK_TARGETING
    if (has_place) params[3] = nullptr;                // whichever way it flies
    OrderedJson json = {{"autoContinue", true}, {"command", item.command}, {"doJumpId", i + 1},
                        {"frame", item.frame},  {"params", params},        {"type", "SimpleItem"}};
    if (has_place) {
      json["AMSLAltAboveTerrain"] = nullptr;
      json["Altitude"] = item.place.altitude_m;
      json["AltitudeMode"] = 1;
    }
    list.push_back(json);
  }
  const double speed = std::clamp(report.style.speed, 1.0, 15.0);
  const OrderedJson plan = {
      {"fileType", "Plan"},
      {"version", 1},
      {"groundStation", "QGroundControl"},
      {"geoFence", {{"circles", OrderedJson::array()}, {"polygons", OrderedJson::array()}, {"version", 2}}},
      {"rallyPoints", {{"points", OrderedJson::array()}, {"version", 2}}},
      {"mission",
       {{"version", 2},
        {"firmwareType", 12},
        {"vehicleType", 2},
        {"cruiseSpeed", std::max(15.0, speed)},
        {"hoverSpeed", speed},
        {"plannedHomePosition", {home.latitude_deg, home.longitude_deg, home.altitude_m}},
        {"items", list}}}};
  return plan.dump(2) + "\n";
}

std::string MakeWaypoints(const GapReport& report, const WorldPlacement& world) {
  const std::vector<MissionItem> items = MakeMission(report, world);
  if (items.empty()) return "";
  const Geodetic home = HomeOf(items, report, world);
  std::string text = "QGC WPL 110\n";
  text += Format("0\t1\t0\t%d\t0\t0\t0\t0\t%.8f\t%.8f\t%.3f\t1\n", kWaypoint, home.latitude_deg, home.longitude_deg,
                 home.altitude_m);
  for (size_t i = 0; i < items.size(); ++i) {
    const MissionItem& item = items[i];
    const double last = item.command == kMountControl ? 2 : item.place.altitude_m;
    text += Format("%zu\t0\t%d\t%d\t%.3f\t%.3f\t%.3f\t%.3f\t%.8f\t%.8f\t%.3f\t1\n", i + 1, item.frame, item.command,
                   item.params[0], item.params[1], item.params[2], item.params[3], item.place.latitude_deg,
                   item.place.longitude_deg, last);
  }
  return text;
}

}  // namespace mapmend

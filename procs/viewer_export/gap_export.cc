#include "procs/viewer_export/gap_export.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "libs/base/text_format.h"
#include "libs/drawing/svg_canvas.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

const char* KindName(Gap::Kind kind) {
  return kind == Gap::Kind::kStretch ? "stretch" : kind == Gap::Kind::kConnection ? "connection" : "ground";
}

// Longitude and latitude of a place on the plane of the report.
OrderedJson LonLat(const WorldPlacement& world, const Eigen::Vector2d& enu) {
  const Geodetic place = world.frame.ToGeodetic({enu.x(), enu.y(), 0});
  return {std::round(place.longitude_deg * 1e9) / 1e9, std::round(place.latitude_deg * 1e9) / 1e9};
}

OrderedJson Properties(const Gap& gap) {
  OrderedJson json = {{"kind", KindName(gap.kind)}, {"text", gap.text}};
  if (gap.kind == Gap::Kind::kStretch) {
    json["first_frame"] = gap.first_frame;
    json["last_frame"] = gap.last_frame;
    json["seconds"] = gap.seconds;
    if (gap.length > 0) json["length"] = gap.length;
  } else if (gap.kind == Gap::Kind::kConnection) {
    json["components"] = {gap.component_a, gap.component_b};
    if (gap.length > 0) json["length"] = gap.length;
  } else {
    json["area"] = gap.region.area;
    json["area_unseen"] = gap.region.area_unseen;
    json["fewest_images"] = gap.region.fewest_images;
  }
  return json;
}

OrderedJson Geometry(const Gap& gap, const WorldPlacement& world) {
  OrderedJson coordinates = OrderedJson::array();
  if (gap.kind != Gap::Kind::kGround) {
    for (const Eigen::Vector3d& p : gap.line) coordinates.push_back(LonLat(world, p.head<2>()));
    return {{"type", "LineString"}, {"coordinates", coordinates}};
  }
  for (const std::vector<Eigen::Vector2d>& ring : gap.region.rings) {
    OrderedJson points = OrderedJson::array();
    for (size_t i = 0; i <= ring.size(); ++i) points.push_back(LonLat(world, ring[i % ring.size()]));
    coordinates.push_back(points);
  }
  return {{"type", "Polygon"}, {"coordinates", coordinates}};
}

bool HasPlace(const Gap& gap) { return gap.kind == Gap::Kind::kGround || gap.line.size() >= 2; }

std::string KmlRing(const std::vector<Eigen::Vector2d>& ring, const WorldPlacement& world) {
  std::string text = "<LinearRing><coordinates>";
  for (size_t i = 0; i <= ring.size(); ++i) {
    const OrderedJson at = LonLat(world, ring[i % ring.size()]);
    text += Format("%.8f,%.8f ", at[0].get<double>(), at[1].get<double>());
  }
  return text + "</coordinates></LinearRing>";
}

}  // namespace

std::string MakeGapsJson(const GapReport& report) {
  OrderedJson json = {{"unit", report.Unit()}};
  if (report.has_ground) {
    json["area_seen"] = report.coverage.area_seen;
    json["area_seen_by_enough"] = report.coverage.area_enough;
    json["area_seen_by_few"] = report.coverage.area_few;
    double inside = 0, unseen = 0;
    for (const CoverageRegion& region : report.coverage.regions) {
      inside += region.area;
      unseen += region.area_unseen;
    }
    json["area_to_fly_again"] = inside;
    json["area_unseen_inside"] = unseen;
    json["flight"] = {{"height", report.style.height},
                      {"heading_deg", report.style.heading_deg},
                      {"camera_pitch_deg", report.style.pitch_deg},
                      {"forward_overlap", report.style.forward_overlap},
                      {"speed", report.style.speed},
                      {"footprint_length", report.style.footprint_length},
                      {"footprint_width", report.style.footprint_width}};
  } else {
    json["problem"] = "no ground is seen from above, so nothing can be said of where the map is thin";
  }
  json["list"] = OrderedJson::array();
  for (const Gap& gap : report.gaps) json["list"].push_back(Properties(gap));
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
}

std::string MakeGapsGeoJson(const GapReport& report, const WorldPlacement& world) {
  std::string text = "{\"type\": \"FeatureCollection\", \"features\": [";
  const char* between = "\n";
  for (const Gap& gap : report.gaps) {
    if (!HasPlace(gap)) continue;
    const OrderedJson feature = {
        {"type", "Feature"}, {"properties", Properties(gap)}, {"geometry", Geometry(gap, world)}};
    text += between + feature.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
    between = ",\n";
  }
  return text + "\n]}\n";
}

std::string MakeGapsKmlFolder(const GapReport& report, const WorldPlacement& world) {
  std::string text = "<Folder><name>gaps</name>\n";
  for (const Gap& gap : report.gaps) {
    if (!HasPlace(gap)) continue;
    text += "<Placemark><name>" + EscapeXml(gap.text) +
            "</name><Style><LineStyle><color>ff1b02d0</color><width>3</width></LineStyle><PolyStyle><color>601b02d0"
            "</color></PolyStyle></Style>";
    if (gap.kind == Gap::Kind::kGround) {
      text += "<Polygon><tessellate>1</tessellate>";
      for (size_t i = 0; i < gap.region.rings.size(); ++i) {
        const char* side = i == 0 ? "outerBoundaryIs" : "innerBoundaryIs";
        text += std::string("<") + side + ">" + KmlRing(gap.region.rings[i], world) + "</" + side + ">";
      }
      text += "</Polygon>";
    } else {
      text += "<LineString><tessellate>1</tessellate><coordinates>";
      for (const Eigen::Vector3d& p : gap.line) {
        const OrderedJson at = LonLat(world, p.head<2>());
        text += Format("%.8f,%.8f ", at[0].get<double>(), at[1].get<double>());
      }
      text += "</coordinates></LineString>";
    }
    text += "</Placemark>\n";
  }
  return text + "</Folder>\n";
}

std::string MakeGapsKml(const GapReport& report, const WorldPlacement& world) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document>\n"
         "<name>what to fly again</name>\n" +
         MakeGapsKmlFolder(report, world) + "</Document></kml>\n";
}

}  // namespace mapmend

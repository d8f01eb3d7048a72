#include "procs/viewer_export/geo_export.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "libs/base/text_format.h"
#include "libs/drawing/canvas.h"
#include "libs/drawing/svg_canvas.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/ground.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

// A feature before it is written in one or the other format.
struct Feature {
  enum class Kind { kPoint, kLine, kPolygon };
  Kind kind = Kind::kPoint;
  std::string folder, name, description, color;  // color: "#rrggbb"
  std::vector<Geodetic> places;                  // of a polygon: without the first one again
  OrderedJson properties = OrderedJson::object();
};

double Rounded(double value, double unit) { return std::round(value / unit) * unit; }

OrderedJson Coordinates(const Geodetic& place) {
  return {Rounded(place.longitude_deg, 1e-9), Rounded(place.latitude_deg, 1e-9), Rounded(place.altitude_m, 1e-3)};
}

std::string NameOfPart(const Snapshot& snapshot, int component) {
  if (snapshot.components.size() == 1) return "the map";
  return component == 0 ? "main map" : "part " + std::to_string(component);
}

// Seen from above, counter-clockwise (A. Andrew 1979).
std::vector<Eigen::Vector3d> ConvexHull(std::vector<Eigen::Vector3d> points) {
  std::sort(points.begin(), points.end(),
            [](const auto& a, const auto& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  std::vector<Eigen::Vector3d> hull;
  const auto add = [&](const Eigen::Vector3d& p, size_t begin) {
    const auto turns_right = [&] {
      const Eigen::Vector3d a = hull.back() - hull[hull.size() - 2], b = p - hull.back();
      return a.x() * b.y() - a.y() * b.x() <= 0;
    };
    while (hull.size() >= begin + 2 && turns_right()) hull.pop_back();
    hull.push_back(p);
  };
  for (const Eigen::Vector3d& p : points) add(p, 0);
  const size_t lower = hull.size() - 1;
  for (auto it = points.rbegin(); it != points.rend(); ++it) {
    if (it != points.rbegin()) add(*it, lower);
  }
  hull.pop_back();  // the first one again
  return hull;
}

class FeatureList {
 public:
  FeatureList(const Snapshot& snapshot, const WorldPlacement& world) : snapshot_(snapshot), world_(world) {
    for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
      if (world.components[static_cast<size_t>(c)].success) AddComponent(c);
    }
  }
  const std::vector<Feature>& features() const { return features_; }

 private:
  void AddComponent(int c) {
    const SnapshotComponent& component = snapshot_.components[c];
    for (const int index : component.submaps) AddPath(c, snapshot_.submaps[index]);
    for (const int index : component.submaps) AddLoss(c, snapshot_.submaps[index]);
    const auto ground = FindGround(snapshot_, c, true);
    if (!ground) return;
    for (const int index : component.submaps) AddOutline(c, index, ground->footprints);
    for (const Footprint& footprint : ground->footprints) AddFootprint(c, footprint);
  }

  Feature Make(Feature::Kind kind, const char* folder, int c, const SnapshotSubmap& submap) const {
    Feature feature;
    feature.kind = kind;
    feature.folder = folder;
    feature.color = CategoryColor(submap.number);
    feature.properties = {{"kind", folder}, {"component", c}, {"submap", submap.number}};
    return feature;
  }
  Geodetic Place(const Eigen::Vector3d& enu) const { return world_.frame.ToGeodetic(enu); }

  // A piece for each stretch without a gap in its frames.
  void AddPath(int c, const SnapshotSubmap& submap) {
    const Placement& placement = world_.components[static_cast<size_t>(c)];
    for (size_t begin = 0; begin < submap.frames.size();) {
      size_t end = begin + 1;
      while (end < submap.frames.size() && submap.frames[end].frame - submap.frames[end - 1].frame <= kSmallStep) ++end;
      Feature feature = Make(Feature::Kind::kLine, "path", c, submap);
      for (size_t i = begin; i < end; ++i) feature.places.push_back(Place(submap.frames[i].cam_from_root.Center()));
      const int first = submap.frames[begin].frame, last = submap.frames[end - 1].frame;
      feature.name = SubmapName(submap);
      feature.description = NameOfPart(snapshot_, c) + Format(", frames %d to %d; known to %.1f m horizontally", first,
                                                              last, placement.SigmaHorizontal());
      if (snapshot_.components.size() > 1) feature.description += "; not joined to the other parts";
      feature.properties["first_frame"] = first;
      feature.properties["last_frame"] = last;
      feature.properties["sigma_horizontal_m"] = Rounded(placement.SigmaHorizontal(), 1e-3);
      if (feature.places.size() > 1) features_.push_back(std::move(feature));
      begin = end;
    }
  }
  void AddLoss(int c, const SnapshotSubmap& submap) {
    if (!submap.Lost() || submap.frames.empty()) return;
    Feature feature = Make(Feature::Kind::kPoint, "losses", c, submap);
    feature.places.push_back(Place(submap.frames.back().cam_from_root.Center()));
    feature.color = "#d0021b";
    feature.name = "tracking lost after frame " + std::to_string(submap.submap->last_frame);
    feature.description = SubmapName(submap) + ": " + ReadableReason(submap.submap->end_reason);
    feature.properties["frame"] = submap.submap->last_frame;
    feature.properties["reason"] = submap.submap->end_reason;
    features_.push_back(std::move(feature));
  }
  // What a submap's footprints span.
  void AddOutline(int c, int index, const std::vector<Footprint>& footprints) {
    const SnapshotSubmap& submap = snapshot_.submaps[index];
    std::vector<Eigen::Vector3d> corners;
    for (const Footprint& footprint : footprints) {
      if (footprint.submap == index) corners.insert(corners.end(), footprint.corners.begin(), footprint.corners.end());
    }
    if (corners.empty()) return;
    Feature feature = Make(Feature::Kind::kPolygon, "submaps", c, submap);
    for (const Eigen::Vector3d& corner : ConvexHull(corners)) feature.places.push_back(Place(corner));
    feature.name = SubmapName(submap);
    feature.description = NameOfPart(snapshot_, c) + Format(", %zu frames", submap.frames.size());
    features_.push_back(std::move(feature));
  }
  void AddFootprint(int c, const Footprint& footprint) {
    const SnapshotSubmap& submap = snapshot_.submaps[footprint.submap];
    Feature feature = Make(Feature::Kind::kPolygon, "footprints", c, submap);
    for (const Eigen::Vector3d& corner : footprint.corners) feature.places.push_back(Place(corner));
    // RFC 7946: outer rings run counter-clockwise.
    double twice = 0;
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d &a = footprint.corners[i], &b = footprint.corners[(i + 1) % 4];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    if (twice < 0) std::reverse(feature.places.begin(), feature.places.end());
    const int frame = submap.submap->keyframes.at(footprint.keyframe).frame;
    feature.name = "frame " + std::to_string(frame);
    feature.properties["frame"] = frame;
    feature.properties["keyframe"] = footprint.keyframe.value;
    feature.properties["time_s"] = 1e-6 * static_cast<double>(footprint.utime);
    features_.push_back(std::move(feature));
  }

  static constexpr int kSmallStep = 5;  // frames
  const Snapshot& snapshot_;
  const WorldPlacement& world_;
  std::vector<Feature> features_;
};

OrderedJson Geometry(const Feature& feature) {
  OrderedJson coordinates = OrderedJson::array();
  for (const Geodetic& place : feature.places) coordinates.push_back(Coordinates(place));
  if (feature.kind == Feature::Kind::kPoint) return {{"type", "Point"}, {"coordinates", coordinates[0]}};
  if (feature.kind == Feature::Kind::kLine) return {{"type", "LineString"}, {"coordinates", coordinates}};
  coordinates.push_back(coordinates[0]);
  return {{"type", "Polygon"}, {"coordinates", OrderedJson::array({coordinates})}};
}

// KML has aabbggrr.
std::string KmlColor(const std::string& color, const char* alpha) {
  return alpha + color.substr(5, 2) + color.substr(3, 2) + color.substr(1, 2);
}

std::string KmlCoordinates(const std::vector<Geodetic>& places, bool close) {
  std::string text = "<coordinates>";
  for (size_t i = 0; i < places.size() + (close ? 1 : 0); ++i) {
    const Geodetic& place = places[i % places.size()];
    text += Format("%s%.8f,%.8f,%.2f", i == 0 ? "" : " ", place.longitude_deg, place.latitude_deg, place.altitude_m);
  }
  return text + "</coordinates>";
}

std::string KmlPlacemark(const Feature& feature) {
  std::string text = "<Placemark><name>" + EscapeXml(feature.name) + "</name>";
  if (!feature.description.empty()) text += "<description>" + EscapeXml(feature.description) + "</description>";
  text += "<Style><LineStyle><color>" + KmlColor(feature.color, "ff") + "</color><width>" +
          (feature.kind == Feature::Kind::kLine ? "3" : "1") + "</width></LineStyle><PolyStyle><color>" +
          KmlColor(feature.color, "20") + "</color></PolyStyle><IconStyle><color>" + KmlColor(feature.color, "ff") +
          "</color></IconStyle></Style>";
  switch (feature.kind) {
    case Feature::Kind::kPoint:
      text += "<Point>" + KmlCoordinates(feature.places, false) + "</Point>";
      break;
    case Feature::Kind::kLine:
      text += "<LineString><tessellate>1</tessellate>" + KmlCoordinates(feature.places, false) + "</LineString>";
      break;
    case Feature::Kind::kPolygon:
      text += "<Polygon><tessellate>1</tessellate><outerBoundaryIs><LinearRing>" +
              KmlCoordinates(feature.places, true) + "</LinearRing></outerBoundaryIs></Polygon>";
      break;
  }
  return text + "</Placemark>\n";
}

}  // namespace

std::string MakePathGeoJson(const Snapshot& snapshot, const WorldPlacement& world) {
  const FeatureList list(snapshot, world);
  std::string text = "{\"type\": \"FeatureCollection\", \"features\": [\n";
  for (size_t i = 0; i < list.features().size(); ++i) {
    const Feature& feature = list.features()[i];
    OrderedJson properties = feature.properties;
    properties["name"] = feature.name;
    if (!feature.description.empty()) properties["description"] = feature.description;
    properties["color"] = feature.color;
    const OrderedJson json = {{"type", "Feature"}, {"properties", properties}, {"geometry", Geometry(feature)}};
    text += json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace) +
            (i + 1 < list.features().size() ? ",\n" : "\n");
  }
  return text + "]}\n";
}

std::string MakeMapKml(const Snapshot& snapshot, const WorldPlacement& world, const std::string& more) {
  const FeatureList list(snapshot, world);
  std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document>\n"
      "<name>mapmend</name>\n";
  for (const char* folder : {"path", "losses", "submaps", "footprints"}) {
    std::string placemarks;
    for (const Feature& feature : list.features()) {
      if (feature.folder == folder) placemarks += KmlPlacemark(feature);
    }
    if (!placemarks.empty()) text += std::string("<Folder><name>") + folder + "</name>\n" + placemarks + "</Folder>\n";
  }
  return text + more + "</Document></kml>\n";
}

}  // namespace mapmend

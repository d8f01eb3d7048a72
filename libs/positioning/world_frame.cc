#include "libs/positioning/world_frame.h"

#include <GeographicLib/LocalCartesian.hpp>
#include <GeographicLib/UTMUPS.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace mapmend {
namespace {

using GeographicLib::UTMUPS;

double OrZero(double altitude) { return std::isnan(altitude) ? 0 : altitude; }

// How the grid of a zone differs from the ground at a place.
struct GridDistortion {
  double convergence_deg = 0;  // of grid north, clockwise of true north
  double scale = 1;            // of lengths
};

GridDistortion DistortionAt(const Geodetic& place, int zone) {
  int found_zone = 0;
  bool is_north = true;
  double easting = 0, northing = 0;
  GridDistortion distortion;
  UTMUPS::Forward(place.latitude_deg, place.longitude_deg, found_zone, is_north, easting, northing,
                  distortion.convergence_deg, distortion.scale, zone);
  return distortion;
}

}  // namespace

Geodetic ParseGeodetic(const std::string& text, const std::string& what) {
  Geodetic place;
  std::istringstream in(text);
  char comma = 0, second = 0;
  const bool two = static_cast<bool>(in >> place.latitude_deg >> comma >> place.longitude_deg) && comma == ',';
  const bool end = two && (in >> std::ws).eof();
  const bool three = two && !end && in >> second >> place.altitude_m && second == ',' && (in >> std::ws).eof();
  if ((!end && !three) || std::abs(place.latitude_deg) > 90 || std::abs(place.longitude_deg) > 360)
    throw std::runtime_error(what + " " + text + ": expected LATITUDE,LONGITUDE or LATITUDE,LONGITUDE,ALTITUDE");
  return place;
}

std::optional<Geodetic> FindOrigin(const std::string& path) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line) && line.starts_with("#");) {
    const size_t at = line.find("origin:");
    Geodetic place;
    if (at != std::string::npos && std::sscanf(line.c_str() + at, "origin: %lf%*[, ]%lf%*[, ]%lf", &place.latitude_deg,
                                               &place.longitude_deg, &place.altitude_m) == 3)
      return place;
  }
  return std::nullopt;
}

LocalFrame::LocalFrame(const Geodetic& origin)
    : origin_(origin),
      local_(std::make_unique<GeographicLib::LocalCartesian>(origin.latitude_deg, origin.longitude_deg,
                                                             OrZero(origin.altitude_m))) {
  origin_.altitude_m = OrZero(origin.altitude_m);
}

LocalFrame::~LocalFrame() = default;
LocalFrame::LocalFrame(const LocalFrame& other) : LocalFrame(other.origin_) {}
LocalFrame& LocalFrame::operator=(const LocalFrame& other) {
  origin_ = other.origin_;
  *local_ = *other.local_;
  return *this;
}

Eigen::Vector3d LocalFrame::ToEnu(const Geodetic& place) const {
  Eigen::Vector3d enu;
  local_->Forward(place.latitude_deg, place.longitude_deg, OrZero(place.altitude_m), enu.x(), enu.y(), enu.z());
  return enu;
}

Geodetic LocalFrame::ToGeodetic(const Eigen::Vector3d& enu) const {
  Geodetic place;
  local_->Reverse(enu.x(), enu.y(), enu.z(), place.latitude_deg, place.longitude_deg, place.altitude_m);
  return place;
}

UtmFrame::UtmFrame(const Geodetic& origin) {
  double easting = 0, northing = 0;
  UTMUPS::Forward(origin.latitude_deg, origin.longitude_deg, zone_, is_north_, easting, northing, UTMUPS::UTM);
}

Eigen::Vector3d UtmFrame::FromGeodetic(const Geodetic& place) const {
  int zone = 0;
  bool is_north = true;
  double easting = 0, northing = 0;
  UTMUPS::Forward(place.latitude_deg, place.longitude_deg, zone, is_north, easting, northing, zone_);
  // Beyond the equator numbers go on.
  if (is_north != is_north_) northing += is_north ? UTMUPS::UTMShift() : -UTMUPS::UTMShift();
  return {easting, northing, place.altitude_m};
}

double UtmFrame::ConvergenceDeg(const Geodetic& place) const { return DistortionAt(place, zone_).convergence_deg; }

double UtmFrame::Scale(const Geodetic& place) const { return DistortionAt(place, zone_).scale; }

std::string UtmFrame::Name() const { return "UTM zone " + std::to_string(zone_) + (is_north_ ? " N" : " S"); }

Geodetic FromUtm(int zone, bool is_north, double easting, double northing) {
  Geodetic place;
  UTMUPS::Reverse(zone, is_north, easting, northing, place.latitude_deg, place.longitude_deg);
  return place;
}

}  // namespace mapmend

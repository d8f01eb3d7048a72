#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

namespace GeographicLib {
class LocalCartesian;
}  // namespace GeographicLib

namespace mapmend {

struct Geodetic {
  double latitude_deg = 0, longitude_deg = 0;  // WGS 84
  double altitude_m = 0;
};

// "28.04125,-82.69847" or with an altitude as third. Throws std::runtime_error with one line that begins with `what`.
Geodetic ParseGeodetic(const std::string& text, const std::string& what);

// The origin that a comment of a text file tells: "# ... origin: LATITUDE LONGITUDE ALTITUDE", before its first row.
// nullopt without one, or without the file.
std::optional<Geodetic> FindOrigin(const std::string& path);

// East, north, up from a point of the earth, metres: a plane that touches the ellipsoid there (C. Karney,
// GeographicLib::LocalCartesian).
class LocalFrame {
 public:
  explicit LocalFrame(const Geodetic& origin);
  ~LocalFrame();
  LocalFrame(const LocalFrame& other);
  LocalFrame& operator=(const LocalFrame& other);

  Eigen::Vector3d ToEnu(const Geodetic& place) const;
  Geodetic ToGeodetic(const Eigen::Vector3d& enu) const;
  const Geodetic& origin() const { return origin_; }

 private:
  Geodetic origin_;
  std::unique_ptr<GeographicLib::LocalCartesian> local_;
};

// Easting, northing, altitude in the zone of the Universal Transverse Mercator grid that holds a place, metres. Beyond
// its border places stay in the same zone.
class UtmFrame {
 public:
  explicit UtmFrame(const Geodetic& origin);

  Eigen::Vector3d FromGeodetic(const Geodetic& place) const;
  // How far grid north lies clockwise of true north there, degrees (meridian convergence).
  double ConvergenceDeg(const Geodetic& place) const;
  // Length on the grid of a metre on the ground there.
  double Scale(const Geodetic& place) const;
  int Epsg() const { return (is_north_ ? 32600 : 32700) + zone_; }
  std::string Name() const;  // "UTM zone 17 N"

 private:
  int zone_ = 0;
  bool is_north_ = true;
};

// The other way round, for files whose positions are on the grid.
Geodetic FromUtm(int zone, bool is_north, double easting, double northing);

}  // namespace mapmend

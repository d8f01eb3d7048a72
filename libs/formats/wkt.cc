#include "libs/formats/wkt.h"

#include <stdexcept>

#include "libs/base/text_format.h"

namespace mapmend {
namespace {

constexpr char kWgs84[] =
    R"(DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],)"
    R"(PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]])";

std::string Geographic(int epsg) {
  return std::string("GEOGCS[\"WGS 84\",") + kWgs84 + ",AUTHORITY[\"EPSG\",\"" + std::to_string(epsg) + "\"]]";
}

std::string Utm(int zone, bool north) {
  std::string text = Format("PROJCS[\"WGS 84 / UTM zone %d%s\",", zone, north ? "N" : "S") + Geographic(4326);
  text += R"(,PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],)";
  text += Format("PARAMETER[\"central_meridian\",%d],", 6 * zone - 183);
  text += R"(PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],)";
  text += Format("PARAMETER[\"false_northing\",%d],", north ? 0 : 10000000);
  text += R"(UNIT["metre",1,AUTHORITY["EPSG","9001"]],AXIS["Easting",EAST],AXIS["Northing",NORTH],)";
  return text + Format("AUTHORITY[\"EPSG\",\"%d\"]]", (north ? 32600 : 32700) + zone);
}

}  // namespace

std::string WellKnownText(int epsg) {
  if (epsg == 4326 || epsg == 4979) return Geographic(epsg);
  if (epsg > 32600 && epsg <= 32660) return Utm(epsg - 32600, true);
  if (epsg > 32700 && epsg <= 32760) return Utm(epsg - 32700, false);
  throw std::runtime_error("no description of the coordinate reference system EPSG:" + std::to_string(epsg) +
                           " is known; there are WGS 84 and its UTM zones");
}

}  // namespace mapmend

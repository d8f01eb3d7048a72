#include "libs/positioning/exif_positions.h"

#include <algorithm>
#include <cmath>
#include <exiv2/exiv2.hpp>

#include "libs/positioning/position_formats.h"

namespace mapmend {
namespace {

double Degrees(const Exiv2::ExifData& tags, const char* key, const char* reference_key) {
  const auto tag = tags.findKey(Exiv2::ExifKey(key));
  if (tag == tags.end() || tag->count() < 3) return PositionFix::kNotTold;
  double value = 0, unit = 1;
  for (long i = 0; i < 3; ++i, unit *= 60) {
    const Exiv2::Rational part = tag->toRational(i);
    if (part.second != 0) value += static_cast<double>(part.first) / part.second / unit;
  }
  const auto reference = tags.findKey(Exiv2::ExifKey(reference_key));
  const std::string side = reference == tags.end() ? "" : reference->toString();
  return !side.empty() && (side[0] == 'S' || side[0] == 'W') ? -value : value;
}

double Altitude(const Exiv2::ExifData& tags) {
  const auto tag = tags.findKey(Exiv2::ExifKey("Exif.GPSInfo.GPSAltitude"));
  if (tag == tags.end() || tag->count() < 1 || tag->toRational(0).second == 0) return PositionFix::kNotTold;
  const Exiv2::Rational value = tag->toRational(0);
  const auto reference = tags.findKey(Exiv2::ExifKey("Exif.GPSInfo.GPSAltitudeRef"));
  const bool is_below = reference != tags.end() && reference->count() > 0 && reference->toLong(0) == 1;
  const double altitude = static_cast<double>(value.first) / value.second;
  return is_below ? -altitude : altitude;
}

// The DJI name space is not known to exiv2: "Xmp.drone-dji.GimbalYawDegree" is found by its end.
double XmpNumber(const Exiv2::XmpData& tags, const std::string& name) {
  for (const auto& tag : tags) {
    if (tag.key().ends_with("." + name)) return positions::ParseLength(tag.toString()).value_or(PositionFix::kNotTold);
  }
  return PositionFix::kNotTold;
}

}  // namespace

std::optional<PositionFix> ReadExifPosition(const std::string& file) {
  try {
    const auto image = Exiv2::ImageFactory::open(file);
    image->readMetadata();
    const Exiv2::ExifData& tags = image->exifData();
    PositionFix fix;
    fix.latitude_deg = Degrees(tags, "Exif.GPSInfo.GPSLatitude", "Exif.GPSInfo.GPSLatitudeRef");
    fix.longitude_deg = Degrees(tags, "Exif.GPSInfo.GPSLongitude", "Exif.GPSInfo.GPSLongitudeRef");
    if (!ProblemOf(fix).empty()) return std::nullopt;
    fix.altitude_m = Altitude(tags);
    fix.yaw_deg = XmpNumber(image->xmpData(), "GimbalYawDegree");
    fix.pitch_deg = XmpNumber(image->xmpData(), "GimbalPitchDegree");
    fix.roll_deg = XmpNumber(image->xmpData(), "GimbalRollDegree");
    const double relative = XmpNumber(image->xmpData(), "RelativeAltitude");
    if (!std::isnan(relative) && !fix.HasAltitude()) fix.altitude_m = relative;
    return fix;
  } catch (const std::exception&) {  // unreadable, or of a format without such tags
    return std::nullopt;
  }
}

std::vector<std::optional<PositionFix>> ReadExifPositions(const std::vector<std::string>& files) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  constexpr size_t kProbed = 20;
  std::vector<std::optional<PositionFix>> fixes;
  bool is_any = false;
  for (const std::string& file : files) {
    fixes.push_back(ReadExifPosition(file));
    is_any = is_any || fixes.back();
    if (!is_any && fixes.size() >= kProbed) return {};
  }
  return is_any ? fixes : std::vector<std::optional<PositionFix>>();
}

}  // namespace mapmend

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <regex>
#include <stdexcept>

#include "libs/base/text_table.h"
#include "libs/base/time_unit.h"
#include "libs/positioning/position_formats.h"

namespace mapmend::positions {
namespace {

// Column names in lower case without blanks, underscores, hyphens and units in brackets.
std::string Plain(const std::string& name) {
  std::string plain;
  for (const char c : LowerCase(name.substr(0, name.find_first_of("[(")))) {
    if (c != ' ' && c != '_' && c != '-' && c != '#') plain += c;
  }
  return plain;
}

class Columns {
 public:
  explicit Columns(const std::vector<std::string>& head) {
    for (const std::string& name : head) names_.push_back(Plain(name));
  }
  // The first of these names that there is, -1 without.
  int Find(std::initializer_list<const char*> names) const {
    for (const char* name : names) {
      const auto it = std::find(names_.begin(), names_.end(), name);
      if (it != names_.end()) return static_cast<int>(it - names_.begin());
    }
    return -1;
  }

 private:
  std::vector<std::string> names_;
};

struct TableColumns {
  explicit TableColumns(const Columns& c)
      : latitude(c.Find({"latitudedeg", "latitude", "lat", "gpslatitude", "latdeg"})),
        longitude(c.Find({"longitudedeg", "longitude", "lon", "lng", "long", "gpslongitude", "londeg"})),
        latitude_ref(c.Find({"gpslatituderef", "latituderef"})),
        longitude_ref(c.Find({"gpslongituderef", "longituderef"})),
        altitude(c.Find({"altitudem", "altitude", "alt", "gpsaltitude", "height", "ele", "elevation", "altm"})),
        time(c.Find({"times", "time", "timestamp", "t", "utc", "datetime", "datetimeoriginal", "subsecdatetimeoriginal",
                     "gpsdatetime", "createdate", "date"})),
        name(c.Find({"filename", "file", "image", "imagename", "photo", "label", "name", "sourcefile"})),
        sigma_horizontal(c.Find({"sigmahorizontalm", "sigmahorizontal", "horizontalaccuracy", "hacc", "gpsxyaccuracy",
                                 "gpshpositioningerror", "accuracy", "accuracym"})),
        sigma_vertical(c.Find(
            {"sigmaverticalm", "sigmavertical", "verticalaccuracy", "vacc", "gpszaccuracy", "verticalaccuracym"})),
        yaw(c.Find({"camerayaw", "gimbalyawdegree", "gimbalyaw"})),
        pitch(c.Find({"camerapitch", "gimbalpitchdegree", "gimbalpitch"})),
        roll(c.Find({"cameraroll", "gimbalrolldegree", "gimbalroll"})) {}
  int latitude, longitude, latitude_ref, longitude_ref, altitude, time, name, sigma_horizontal, sigma_vertical, yaw,
      pitch, roll;
};

std::string FieldOf(const std::vector<std::string>& fields, int column) {
  return column >= 0 && column < static_cast<int>(fields.size()) ? fields[static_cast<size_t>(column)] : "";
}

double NumberOf(const std::vector<std::string>& fields, int column) {
  return ParseLength(FieldOf(fields, column)).value_or(PositionFix::kNotTold);
}

double AngleOf(const std::vector<std::string>& fields, int column, int reference) {
  const std::optional<double> angle = ParseAngle(FieldOf(fields, column));
  if (!angle) return PositionFix::kNotTold;
  const std::string side = FieldOf(fields, reference);
  return !side.empty() && (side[0] == 'S' || side[0] == 'W') ? -std::abs(*angle) : *angle;
}

Entry ReadRow(const std::vector<std::string>& fields, const TableColumns& columns) {
  Entry entry;
  entry.fix.latitude_deg = AngleOf(fields, columns.latitude, columns.latitude_ref);
  entry.fix.longitude_deg = AngleOf(fields, columns.longitude, columns.longitude_ref);
  entry.fix.altitude_m = NumberOf(fields, columns.altitude);
  entry.fix.sigma_horizontal_m = NumberOf(fields, columns.sigma_horizontal);
  entry.fix.sigma_vertical_m = NumberOf(fields, columns.sigma_vertical);
  entry.fix.yaw_deg = NumberOf(fields, columns.yaw);
  entry.fix.pitch_deg = NumberOf(fields, columns.pitch);
  entry.fix.roll_deg = NumberOf(fields, columns.roll);
  entry.name = std::filesystem::path(FieldOf(fields, columns.name)).filename().string();
  return entry;
}

// Dates, or numbers of one unit.
void ReadTimes(const std::vector<std::string>& texts, const std::string& head, std::vector<Entry>* entries) {
  std::vector<std::string> numbers;
  double ignored = 0;
  for (const std::string& text : texts) {
    if (ParseNumber(text, &ignored)) numbers.push_back(text);
  }
  const TimeUnit unit = numbers.empty() ? TimeUnit::kSeconds : GuessTimeUnit(numbers, head);
  for (size_t i = 0; i < texts.size(); ++i) {
    Entry& entry = (*entries)[i];
    if (ParseNumber(texts[i], &ignored) && ParseTime(texts[i], unit, &entry.fix.utime)) continue;
    if (const auto utime = ParseDateTime(texts[i])) {
      entry.fix.utime = *utime;
    } else if (entry.problem.empty()) {
      entry.problem = "\"" + texts[i].substr(0, 40) + "\" is not a time";
    }
  }
}

char SeparatorOf(const std::string& line) {
  for (const char c : {',', ';', '\t'}) {
    if (line.find(c) != std::string::npos) return c;
  }
  return ' ';
}

std::vector<std::string> Split(const std::string& line, char separator) {
  return separator == ' ' ? SplitBlanks(line) : SplitFields(line, separator);
}

// Of "EPSG:32617" and "WGS84 UTM 17N".
struct Grid {
  bool is_utm = false, is_north = true;
  int zone = 0;
};

std::optional<Grid> ParseGrid(const std::string& line) {
  std::smatch match;
  const std::string lower = LowerCase(line);
  if (std::regex_search(lower, match, std::regex("epsg:\\s*(\\d+)"))) {
    const int code = std::stoi(match[1].str().substr(0, 8));
    if (code == 4326 || code == 4979) return Grid{};
    const bool is_north = code > 32600 && code <= 32660, is_south = code > 32700 && code <= 32760;
    if (is_north || is_south) return Grid{true, is_north, code % 100};
    throw std::runtime_error("EPSG:" + std::to_string(code) + " is not read; WGS 84 (4326) and UTM (326xx, 327xx) are");
  }
  if (std::regex_search(lower, match, std::regex("utm\\s*(?:zone)?\\s*(\\d{1,2})\\s*([ns])")))
    return Grid{true, match[2].str() == "n", std::stoi(match[1].str())};
  if (lower.find("+proj=utm") != std::string::npos && std::regex_search(lower, match, std::regex("\\+zone=(\\d{1,2})")))
    return Grid{true, lower.find("+south") == std::string::npos, std::stoi(match[1].str())};
  if (lower.find("+proj=longlat") != std::string::npos || lower.find("+proj=latlong") != std::string::npos)
    return Grid{};
  return std::nullopt;
}

}  // namespace

std::optional<Entries> ReadTable(const std::string& path, const std::string& text) {
  const std::vector<std::string> lines = SplitLines(text);
  size_t head = 0;
  while (head < lines.size() && Trimmed(lines[head]).empty()) ++head;
  if (head == lines.size()) return std::nullopt;
  const char separator = SeparatorOf(lines[head]);
  const std::vector<std::string> names = Split(lines[head], separator);
  const TableColumns columns{Columns(names)};
  if (columns.latitude < 0 && columns.longitude < 0) return std::nullopt;
  if (columns.latitude < 0 || columns.longitude < 0)
    throw std::runtime_error("positions " + path + ": its columns tell a latitude or a longitude, not both");
  if (columns.time < 0 && columns.name < 0)
    throw std::runtime_error("positions " + path +
                             ": no column tells times or names of images (e.g. time_s, DateTimeOriginal, FileName)");
  Entries entries;
  entries.format = "table with columns " + names[static_cast<size_t>(columns.latitude)] + ", " +
                   names[static_cast<size_t>(columns.longitude)];
  entries.has_times = columns.time >= 0;
  std::vector<std::string> times;
  for (size_t i = head + 1; i < lines.size(); ++i) {
    if (Trimmed(lines[i]).empty() || lines[i][0] == '#') continue;
    const std::vector<std::string> fields = Split(lines[i], separator);
    Entry entry = ReadRow(fields, columns);
    entry.line = static_cast<int>(i) + 1;
    if (fields.size() < 2) entry.problem = "not a row of the table";
    entries.list.push_back(std::move(entry));
    times.push_back(FieldOf(fields, columns.time));
  }
  if (entries.has_times && !times.empty()) ReadTimes(times, names[static_cast<size_t>(columns.time)], &entries.list);
  return entries;
}

std::optional<Entries> ReadGeoTxt(const std::string& path, const std::string& text) {
  const std::vector<std::string> lines = SplitLines(text);
  if (lines.empty()) return std::nullopt;
  std::optional<Grid> grid;
  try {
    grid = ParseGrid(lines[0]);
  } catch (const std::runtime_error& e) {
    throw std::runtime_error("positions " + path + ", line 1: " + e.what());
  }
  if (!grid) return std::nullopt;
  Entries entries;
  entries.format = "geo.txt of OpenDroneMap";
  entries.has_times = false;
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> fields = SplitBlanks(lines[i]);
    if (fields.empty() || fields[0][0] == '#') continue;
    Entry entry;
    entry.line = static_cast<int>(i) + 1;
    entry.name = std::filesystem::path(fields[0]).filename().string();
    double x = 0, y = 0;
    if (fields.size() < 3 || !ParseNumber(fields[1], &x) || !ParseNumber(fields[2], &y)) {
      entry.problem = "expected: image longitude latitude altitude";
    } else {
      const Geodetic place = grid->is_utm ? FromUtm(grid->zone, grid->is_north, x, y) : Geodetic{y, x, 0};
      entry.fix.latitude_deg = place.latitude_deg;
      entry.fix.longitude_deg = place.longitude_deg;
      entry.fix.altitude_m = NumberOf(fields, 3);
      entry.fix.sigma_horizontal_m = NumberOf(fields, 7);  // behind three angles of the vehicle
      entry.fix.sigma_vertical_m = NumberOf(fields, 8);
    }
    entries.list.push_back(std::move(entry));
  }
  return entries;
}

std::optional<Entries> ReadEnuRows(const std::string& path, const std::string& text,
                                   const std::optional<Geodetic>& given_origin) {
  std::optional<Geodetic> origin = given_origin;
  Entries entries;
  entries.format = "rows of time, east, north, up";
  std::vector<std::string> times;
  std::vector<Eigen::Vector3d> enus;
  const std::vector<std::string> lines = SplitLines(text);
  for (size_t i = 0; i < lines.size(); ++i) {
    const std::string line = Trimmed(lines[i]);
    if (line.empty()) continue;
    if (line[0] == '#' || line[0] == '%') {
      const size_t at = LowerCase(line).find("origin");
      double v[3] = {0, 0, 0};
      if (at != std::string::npos && !origin &&
          std::sscanf(line.c_str() + at + 6, "%*[: ]%lf%*[, ]%lf%*[, ]%lf", &v[0], &v[1], &v[2]) >= 2)
        origin = Geodetic{v[0], v[1], v[2]};
      continue;
    }
    const std::vector<std::string> fields = Split(line, SeparatorOf(line));
    std::array<double, 4> row{};
    for (size_t k = 0; k < row.size(); ++k) {
      if (k >= fields.size() || !ParseNumber(fields[k], &row[k])) return std::nullopt;
    }
    Entry entry;
    entry.line = static_cast<int>(i) + 1;
    times.push_back(fields[0]);
    enus.emplace_back(row[1], row[2], row[3]);
    entries.list.push_back(entry);
  }
  if (entries.list.empty()) return std::nullopt;
  if (!origin)
    throw std::runtime_error("positions " + path +
                             ": rows of numbers without names of columns are taken as time, east, north, up in metres, "
                             "which need their origin: give --gps-origin LATITUDE,LONGITUDE,ALTITUDE, or a first line "
                             "that names the columns");
  const LocalFrame frame(*origin);
  for (size_t i = 0; i < enus.size(); ++i) {
    const Geodetic place = frame.ToGeodetic(enus[i]);
    PositionFix& fix = entries.list[i].fix;
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.altitude_m = place.altitude_m;
  }
  ReadTimes(times, "", &entries.list);
  return entries;
}

}  // namespace mapmend::positions

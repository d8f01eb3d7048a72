#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <pugixml.hpp>
#include <regex>
#include <stdexcept>

#include "libs/positioning/position_formats.h"

namespace mapmend::positions {
namespace {

// Whatever the namespace's prefix.
std::string LocalName(const pugi::xml_node& node) {
  const std::string name = node.name();
  const size_t colon = name.find(':');
  return colon == std::string::npos ? name : name.substr(colon + 1);
}

std::string ChildText(const pugi::xml_node& node, const char* name) {
  for (const pugi::xml_node& child : node.children()) {
    if (LocalName(child) == name) return Trimmed(child.text().get());
  }
  return "";
}

// Points of tracks, else of routes or single ones.
class GpxPoints : public pugi::xml_tree_walker {
 public:
  explicit GpxPoints(const char* kind) : kind_(kind) {}
  bool for_each(pugi::xml_node& node) override {
    if (LocalName(node) == kind_) nodes.push_back(node);
    return true;
  }
  std::vector<pugi::xml_node> nodes;

 private:
  const std::string kind_;
};

int LineAt(const std::string& text, ptrdiff_t offset) {
  return 1 + static_cast<int>(std::count(text.begin(), text.begin() + std::max<ptrdiff_t>(0, offset), '\n'));
}

// Whether the two digits behind * are the exclusive or of what stands between $ and *.
bool HasGoodChecksum(const std::string& sentence) {
  const size_t star = sentence.rfind('*');
  if (star == std::string::npos || star + 2 >= sentence.size()) return star == std::string::npos;
  unsigned sum = 0;
  for (size_t i = 1; i < star; ++i) sum ^= static_cast<unsigned char>(sentence[i]);
  return sum == std::strtoul(sentence.substr(star + 1, 2).c_str(), nullptr, 16);
}

// "2803.475,N" is 28 degrees 3.475 minutes.
double NmeaAngle(const std::string& number, const std::string& side) {
  if (number.empty()) return PositionFix::kNotTold;
  const double value = std::strtod(number.c_str(), nullptr), degrees = std::floor(value / 100);
  const double angle = degrees + (value - 100 * degrees) / 60;
  return side == "S" || side == "W" ? -angle : angle;
}

std::optional<double> NmeaSecondsOfDay(const std::string& text) {
  int hour = 0, minute = 0;
  double second = 0;
  if (std::sscanf(text.c_str(), "%2d%2d%lf", &hour, &minute, &second) != 3) return std::nullopt;
  return hour * 3600 + minute * 60 + second;
}

class NmeaReader {
 public:
  void Read(const std::string& sentence, int line) {
    if (!HasGoodChecksum(sentence)) {
      Refuse(line, "its checksum does not fit");
      return;
    }
    const std::vector<std::string> f = SplitFields(sentence.substr(0, sentence.rfind('*')), ',');
    if (f[0].size() != 6) return;
    const std::string kind = f[0].substr(3);
    if (kind == "RMC" && f.size() > 9) ReadDate(f);
    if (kind == "GST" && f.size() > 8) ReadSigmas(f);
    if (kind == "GGA" && f.size() > 9) ReadFix(f, line);
  }
  Entries entries;
  int num_without_date = 0;

 private:
  void Refuse(int line, const std::string& problem) {
    Entry entry;
    entry.line = line;
    entry.problem = problem;
    entries.list.push_back(entry);
  }
  void ReadDate(const std::vector<std::string>& f) {
    const auto seconds = NmeaSecondsOfDay(f[1]);
    int day = 0, month = 0, year = 0;
    if (!seconds || std::sscanf(f[9].c_str(), "%2d%2d%2d", &day, &month, &year) != 3) return;
    if (day < 1 || day > 31 || month < 1 || month > 12) return;
    midnight_ = UtimeOf((year < 80 ? 2000 : 1900) + year, month, day, 0);
    date_seconds_ = *seconds;
    has_date_ = true;
    for (const size_t index : waiting_) SetTime(&entries.list[index].fix);
    waiting_.clear();
  }
  void ReadSigmas(const std::vector<std::string>& f) {
    const double latitude = std::strtod(f[6].c_str(), nullptr), longitude = std::strtod(f[7].c_str(), nullptr);
    const double altitude = std::strtod(f[8].c_str(), nullptr);
    if (latitude > 0 && longitude > 0) sigma_horizontal_ = std::hypot(latitude, longitude) / std::sqrt(2.0);
    if (altitude > 0) sigma_vertical_ = altitude;
  }
  void ReadFix(const std::vector<std::string>& f, int line) {
    const auto seconds = NmeaSecondsOfDay(f[1]);
    if (!seconds || f[6].empty() || f[6] == "0") {
      Refuse(line, "the receiver had no fix");
      return;
    }
    Entry entry;
    entry.line = line;
    entry.fix.latitude_deg = NmeaAngle(f[2], f[3]);
    entry.fix.longitude_deg = NmeaAngle(f[4], f[5]);
    entry.fix.altitude_m = f[9].empty() ? PositionFix::kNotTold : std::strtod(f[9].c_str(), nullptr);
    entry.fix.sigma_horizontal_m = sigma_horizontal_;
    entry.fix.sigma_vertical_m = sigma_vertical_;
    entry.fix.utime = std::llround(*seconds * 1e6);
    if (has_date_) {
      SetTime(&entry.fix);
    } else {
      waiting_.push_back(entries.list.size());
    }
    entries.list.push_back(entry);
  }
  // utime holds the time of day; the nearest one to that of the date's sentence.
  void SetTime(PositionFix* fix) const {
    const double seconds = 1e-6 * static_cast<double>(fix->utime);
    fix->utime += midnight_;
    if (seconds - date_seconds_ > 43200) fix->utime -= int64_t{86400000000};
    if (seconds - date_seconds_ < -43200) fix->utime += int64_t{86400000000};
  }

  bool has_date_ = false;
  int64_t midnight_ = 0;
  double date_seconds_ = 0;
  double sigma_horizontal_ = PositionFix::kNotTold, sigma_vertical_ = PositionFix::kNotTold;
  std::vector<size_t> waiting_;  // fixes before the first date
};

// "[latitude: 28.04125]", also with the misspelling of some cameras.
double Bracketed(const std::string& text, const char* names) {
  std::smatch match;
  const std::regex pattern(std::string("(?:") + names + ")\\s*:\\s*([-+]?[0-9.]+)");
  if (!std::regex_search(text, match, pattern)) return PositionFix::kNotTold;
  return std::strtod(match[1].str().c_str(), nullptr);
}

// Newer cameras tell all in brackets, older ones "GPS(-82.69,28.04,18)": longitude first.
bool ReadCaption(const std::string& text, PositionFix* fix) {
  const std::string lower = LowerCase(text);
  fix->latitude_deg = Bracketed(lower, "latitude");
  fix->longitude_deg = Bracketed(lower, "longitude|longtitude");
  if (fix->latitude_deg == fix->latitude_deg) {
    fix->altitude_m = Bracketed(lower, "abs_alt");
    if (!fix->HasAltitude()) fix->altitude_m = Bracketed(lower, "rel_alt|altitude");
    fix->yaw_deg = Bracketed(lower, "gb_yaw");
    fix->pitch_deg = Bracketed(lower, "gb_pitch");
    fix->roll_deg = Bracketed(lower, "gb_roll");
    return true;
  }
  std::smatch match;
  static const std::regex kOld("gps\\s*\\(\\s*([-0-9.]+)\\s*,\\s*([-0-9.]+)\\s*,?\\s*([-0-9.]*)");
  if (!std::regex_search(lower, match, kOld)) return false;
  fix->longitude_deg = std::strtod(match[1].str().c_str(), nullptr);
  fix->latitude_deg = std::strtod(match[2].str().c_str(), nullptr);
  static const std::regex kHeight("(?:barometer\\s*:|, h)\\s*([-0-9.]+)");
  std::smatch height;
  if (std::regex_search(lower, height, kHeight))
    fix->altitude_m = std::strtod(height[1].str().c_str(), nullptr);
  else if (match[3].length() > 0)
    fix->altitude_m = std::strtod(match[3].str().c_str(), nullptr);
  return true;
}

}  // namespace

std::optional<Entries> ReadGpx(const std::string& path, const std::string& text) {
  const size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string::npos || text[begin] != '<') return std::nullopt;
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (!result)
    throw std::runtime_error("positions " + path + ", line " + std::to_string(LineAt(text, result.offset)) + ": " +
                             result.description());
  Entries entries;
  entries.format = "GPX";
  for (const char* kind : {"trkpt", "rtept", "wpt"}) {
    GpxPoints points(kind);
    document.traverse(points);
    for (const pugi::xml_node& node : points.nodes) {
      Entry entry;
      entry.line = LineAt(text, node.offset_debug());
      entry.fix.latitude_deg = ParseAngle(node.attribute("lat").value()).value_or(PositionFix::kNotTold);
      entry.fix.longitude_deg = ParseAngle(node.attribute("lon").value()).value_or(PositionFix::kNotTold);
      entry.fix.altitude_m = ParseLength(ChildText(node, "ele")).value_or(PositionFix::kNotTold);
      const std::string time = ChildText(node, "time");
      if (const auto utime = ParseDateTime(time)) {
        entry.fix.utime = *utime;
      } else {
        entry.problem = time.empty() ? "has no time" : "\"" + time.substr(0, 40) + "\" is not a time";
      }
      entries.list.push_back(entry);
    }
    if (!entries.list.empty()) break;
  }
  return entries;
}

std::optional<Entries> ReadNmea(const std::string& path, const std::string& text) {
  const std::vector<std::string> lines = SplitLines(text);
  const auto is_sentence = [](const std::string& line) { return line.size() > 6 && line[0] == '$' && line[6] == ','; };
  const auto first = std::find_if(lines.begin(), lines.end(), [](const auto& line) { return !Trimmed(line).empty(); });
  if (first == lines.end() || !is_sentence(*first)) return std::nullopt;
  NmeaReader reader;
  reader.entries.format = "NMEA";
  for (size_t i = 0; i < lines.size(); ++i) {
    if (is_sentence(lines[i])) reader.Read(lines[i], static_cast<int>(i) + 1);
  }
  if (reader.entries.list.empty())
    throw std::runtime_error("positions " + path + ": NMEA without a GGA sentence, which would tell positions");
  return reader.entries;
}

std::optional<Entries> ReadSubtitles(const std::string& /*path*/, const std::string& text) {
  const std::vector<std::string> lines = SplitLines(text);
  Entries entries;
  entries.format = "subtitles";
  entries.since_first_frame = true;
  bool is_any = false;
  for (size_t i = 0; i < lines.size(); ++i) {
    int hour = 0, minute = 0, second = 0, ms = 0;
    if (lines[i].find("-->") == std::string::npos ||
        std::sscanf(lines[i].c_str(), " %d:%d:%d%*[,.]%d", &hour, &minute, &second, &ms) != 4)
      continue;
    is_any = true;
    std::string caption;
    size_t k = i + 1;
    for (; k < lines.size() && !Trimmed(lines[k]).empty() && lines[k].find("-->") == std::string::npos; ++k)
      caption += lines[k] + " ";
    Entry entry;
    entry.line = static_cast<int>(i) + 1;
    entry.fix.utime = (((hour * int64_t{60} + minute) * 60 + second) * 1000 + ms) * 1000;
    if (!ReadCaption(caption, &entry.fix)) entry.problem = "tells no position";
    entries.list.push_back(entry);
  }
  if (!is_any) return std::nullopt;
  return entries;
}

}  // namespace mapmend::positions

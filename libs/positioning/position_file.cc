#include "libs/positioning/position_file.h"

#include <algorithm>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "libs/positioning/position_formats.h"

namespace mapmend {
namespace {

using positions::Entries;
using positions::Entry;

constexpr const char* kKnown =
    "a table with columns such as time_s, latitude_deg, longitude_deg (or of exiftool -csv), geo.txt of OpenDroneMap, "
    "GPX, NMEA, DJI subtitles, or rows of time, east, north, up";

Entries Parse(const std::string& path, std::string text, const std::optional<Geodetic>& origin) {
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // byte order mark
  if (text.find('\0') != std::string::npos)
    throw std::runtime_error("positions " + path + ": not text; expected " + kKnown);
  for (const auto read : {positions::ReadGpx, positions::ReadNmea, positions::ReadSubtitles, positions::ReadGeoTxt,
                          positions::ReadTable}) {
    if (auto entries = read(path, text)) return std::move(*entries);
  }
  if (auto entries = positions::ReadEnuRows(path, text, origin)) return std::move(*entries);
  throw std::runtime_error("positions " + path + ": no known format; expected " + kKnown);
}

// Where times stand, in their order; subtitles of one second may repeat a position, which is no harm.
void Take(const Entries& entries, PositionFile* file) {
  std::vector<const Entry*> order;
  for (const Entry& entry : entries.list) order.push_back(&entry);
  if (entries.has_times)
    std::stable_sort(order.begin(), order.end(),
                     [](const Entry* a, const Entry* b) { return a->fix.utime < b->fix.utime; });
  FixFilter filter;
  std::vector<std::pair<int, std::string>> refused;
  const bool has_names = std::any_of(order.begin(), order.end(), [](const Entry* e) { return !e->name.empty(); });
  for (const Entry* entry : order) {
    std::string problem = entry->problem;
    if (problem.empty()) problem = entries.has_times ? filter.Add(entry->fix) : ProblemOf(entry->fix);
    if (problem.empty()) {
      file->fixes.push_back(entry->fix);
      if (has_names) file->names.push_back(entry->name);
    } else {
      refused.emplace_back(entry->line, problem);
    }
  }
  std::stable_sort(refused.begin(), refused.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [line, problem] : refused) file->refused.push_back("line " + std::to_string(line) + ": " + problem);
}

}  // namespace

PositionFile ReadPositions(const std::string& path, const std::optional<Geodetic>& origin) {
  const Entries entries = Parse(path, ReadFile(path), origin);
  PositionFile file;
  file.format = entries.format;
  file.has_times = entries.has_times;
  file.since_first_frame = entries.since_first_frame;
  Take(entries, &file);
  if (file.fixes.empty())
    throw std::runtime_error("positions " + path + " (" + file.format + "): not one usable position" +
                             (file.refused.empty() ? "" : "; " + file.refused.front()));
  return file;
}

std::string DescribePositions(const PositionFile& file) {
  std::string text = std::to_string(file.fixes.size()) + " positions (" + file.format + ")";
  if (file.refused.empty()) return text;
  constexpr size_t kTold = 5;
  text += ", " + std::to_string(file.refused.size()) + " refused: ";
  for (size_t i = 0; i < std::min(kTold, file.refused.size()); ++i) text += (i == 0 ? "" : "; ") + file.refused[i];
  return text + (file.refused.size() > kTold ? "; ..." : "");
}

}  // namespace mapmend

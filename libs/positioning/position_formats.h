#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libs/positioning/position_fix.h"
#include "libs/positioning/world_frame.h"

// The formats that position_file.h reads; nobody else includes this.
namespace mapmend::positions {

// A fix as it stands in the file.
struct Entry {
  PositionFix fix;
  std::string name;     // of the image; empty: none
  int line = 0;         // from 1
  std::string problem;  // why it is no good; empty if that is not known here
};

struct Entries {
  std::string format;  // for a person
  std::vector<Entry> list;
  bool has_times = true, since_first_frame = false;
};

// Each returns nullopt if the text is of another format. path is for messages: they throw std::runtime_error with one
// line if it is of this format, and cannot be read.
std::optional<Entries> ReadGpx(const std::string& path, const std::string& text);
std::optional<Entries> ReadNmea(const std::string& path, const std::string& text);
std::optional<Entries> ReadSubtitles(const std::string& path, const std::string& text);
std::optional<Entries> ReadGeoTxt(const std::string& path, const std::string& text);
std::optional<Entries> ReadTable(const std::string& path, const std::string& text);
std::optional<Entries> ReadEnuRows(const std::string& path, const std::string& text,
                                   const std::optional<Geodetic>& origin);

// Lines without their ends (LF, CRLF, CR).
std::vector<std::string> SplitLines(const std::string& text);
std::string Trimmed(const std::string& text);
std::string LowerCase(std::string text);
// Fields separated by a character, quotes taken off.
std::vector<std::string> SplitFields(const std::string& line, char separator);
// Fields separated by blanks.
std::vector<std::string> SplitBlanks(const std::string& line);

// A date and time of the Gregorian calendar, UTC unless an offset is told: "2018:04:29 12:06:46.5",
// "2018-04-29T12:06:46Z", "2018/04/29 12:06:46+02:00". Microseconds since 1970.
std::optional<int64_t> ParseDateTime(const std::string& text);
int64_t UtimeOf(int year, int month, int day, double seconds_of_day);
// Degrees, from "28.04", "28.04 N", "28 deg 2' 28.51\" N", "-82.7".
std::optional<double> ParseAngle(const std::string& text);
// A number with whatever unit behind it: "12.3 m", "5.7 m Below Sea Level" (negative).
std::optional<double> ParseLength(const std::string& text);

}  // namespace mapmend::positions

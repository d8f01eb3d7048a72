#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "libs/positioning/position_formats.h"

namespace mapmend::positions {

std::vector<std::string> SplitLines(const std::string& text) {
  std::vector<std::string> lines;
  std::string line;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\n' && text[i] != '\r') {
      line += text[i];
      continue;
    }
    if (text[i] == '\r' && i + 1 < text.size() && text[i + 1] == '\n') ++i;
    lines.push_back(std::exchange(line, ""));
  }
  if (!line.empty()) lines.push_back(line);
  return lines;
}

std::string Trimmed(const std::string& text) {
  const char* blanks = " \t\r\n\"";
  const size_t begin = text.find_first_not_of(blanks), end = text.find_last_not_of(blanks);
  return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
}

std::string LowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::vector<std::string> SplitFields(const std::string& line, char separator) {
  std::vector<std::string> fields(1);
  bool is_quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"') {
      // Two within quotes stand for one.
      if (is_quoted && i + 1 < line.size() && line[i + 1] == '"')
        fields.back() += line[i++];
      else
        is_quoted = !is_quoted;
    } else if (c == separator && !is_quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  for (std::string& field : fields) field = Trimmed(field);
  return fields;
}

std::vector<std::string> SplitBlanks(const std::string& line) {
  std::vector<std::string> fields;
  std::string field;
  for (const char c : line + " ") {
    if (c != ' ' && c != '\t') {
      field += c;
    } else if (!field.empty()) {
      fields.push_back(std::exchange(field, ""));
    }
  }
  return fields;
}

int64_t UtimeOf(int year, int month, int day, double seconds_of_day) {
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  const int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
  return days * int64_t{86400000000} + std::llround(seconds_of_day * 1e6);
}

std::optional<int64_t> ParseDateTime(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, length = 0;
  double second = 0;
  char separators[3] = {};
  const int n = std::sscanf(text.c_str(), "%4d%c%2d%c%2d%c%2d:%2d:%lf%n", &year, &separators[0], &month, &separators[1],
                            &day, &separators[2], &hour, &minute, &second, &length);
  const auto is_date_separator = [](char c) { return c == ':' || c == '-' || c == '/' || c == '.'; };
  if (n != 9 || !is_date_separator(separators[0]) || !is_date_separator(separators[1]) ||
      (separators[2] != ' ' && separators[2] != 'T' && separators[2] != '_'))
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok() || year < 1970 || hour < 0 || hour > 23 || minute < 0 || minute > 59 || !(second >= 0 && second < 61))
    return std::nullopt;
  const std::string rest = Trimmed(text.substr(static_cast<size_t>(length)));
  double offset_s = 0;
  if (!rest.empty() && rest != "Z" && rest != "UTC") {
    char sign = 0;
    int hours = 0, minutes = 0;
    if (std::sscanf(rest.c_str(), "%c%2d:%2d", &sign, &hours, &minutes) < 2 || (sign != '+' && sign != '-'))
      return std::nullopt;
    offset_s = (sign == '+' ? 1 : -1) * (hours * 60 + minutes) * 60;
  }
  return UtimeOf(year, month, day, hour * 3600 + minute * 60 + second - offset_s);
}

std::optional<double> ParseAngle(const std::string& text) {
  double parts[3] = {0, 0, 0};
  int n = 0;
  bool is_negative = false;
  for (size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.') {
      if (n == 3) return std::nullopt;
      char* end = nullptr;
      parts[n++] = std::strtod(text.c_str() + i, &end);
      i = static_cast<size_t>(end - text.c_str());
      continue;
    }
    if (c == '-' || c == 'S' || c == 'W') is_negative = true;
    ++i;
  }
  if (n == 0) return std::nullopt;
  const double degrees = parts[0] + parts[1] / 60 + parts[2] / 3600;
  return is_negative ? -degrees : degrees;
}

std::optional<double> ParseLength(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || !std::isfinite(value)) return std::nullopt;
  return LowerCase(text).find("below") != std::string::npos ? -std::abs(value) : value;
}

}  // namespace mapmend::positions

#include "libs/base/time_unit.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>

#include "libs/base/text_table.h"

namespace mapmend {
namespace {

constexpr double kEarliest = 6.3e8, kLatest = 4.2e9;  // 1990 and 2103, seconds
constexpr double kLongestStep = 600;                  // seconds from frame to frame
constexpr double kLongestGap = 1e5;                   // of seconds with decimals, from pose to pose
constexpr double kLongestPhotoStep = 15;              // whole seconds without any other sign that they are seconds
constexpr double kLongestVideoStep = 2;               // seconds, for a unit that only the steps tell

std::optional<TimeUnit> UnitInHead(const std::string& head) {
  std::string word;
  for (size_t i = 0, begin = 0; i <= head.size(); ++i) {
    const unsigned char c = i < head.size() ? head[i] : ' ';
    if (std::isalpha(c) || c >= 0x80) {
      word += static_cast<char>(std::tolower(c));
      continue;
    }
    // A single s counts only where it cannot be the end of a word: [s], (s), _s.
    begin = i - word.size();
    const char before = begin > 0 ? head[begin - 1] : ' ';
    if (word.starts_with("nanosec") || word == "nsec" || word == "nsecs" || word == "ns") return TimeUnit::kNanoseconds;
    if (word.starts_with("microsec") || word == "usec" || word == "usecs" || word == "us" || word == "µs")
      return TimeUnit::kMicroseconds;
    if (word.starts_with("millisec") || word == "msec" || word == "msecs" || word == "ms")
      return TimeUnit::kMilliseconds;
    if (word == "second" || word == "seconds" || word == "sec" || word == "secs" ||
        (word == "s" && (before == '[' || before == '(' || before == '_')))
      return TimeUnit::kSeconds;
    word.clear();
  }
  return std::nullopt;
}

double Seconds(double value, TimeUnit unit) { return value * std::pow(1e-3, static_cast<int>(unit)); }

// Zero with fewer than two times.
double MedianStep(const std::vector<double>& values) {
  std::vector<double> steps;
  for (size_t i = 1; i < values.size(); ++i) steps.push_back(std::abs(values[i] - values[i - 1]));
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace

const char* NameOf(TimeUnit unit) {
  static const char* const kNames[] = {"seconds", "milliseconds", "microseconds", "nanoseconds"};
  return kNames[static_cast<int>(unit)];
}

bool ParseTime(std::string_view text, TimeUnit unit, int64_t* utime) {
  size_t at = 0;
  bool negative = false;
  if (at < text.size() && (text[at] == '-' || text[at] == '+')) negative = text[at++] == '-';
  std::string digits;
  int exponent = -3 * static_cast<int>(unit);  // seconds = digits * 10^exponent
  bool point = false;
  for (; at < text.size(); ++at) {
    if (text[at] == '.' && !point) {
      point = true;
    } else if (text[at] >= '0' && text[at] <= '9') {
      digits += text[at];
      exponent -= point;
    } else {
      break;
    }
  }
  if (digits.empty()) return false;
  if (at < text.size()) {
    if (text[at] != 'e' && text[at] != 'E') return false;
    ++at;
    if (at < text.size() && text[at] == '+') ++at;
    int written = 0;
    const auto [end, error] = std::from_chars(text.data() + at, text.data() + text.size(), written);
    if (error != std::errc() || end != text.data() + text.size() || std::abs(written) > 1000) return false;
    exponent += written;
  }
  const size_t zeros = digits.find_first_not_of('0');
  if (zeros == std::string::npos) {
    *utime = 0;
    return true;
  }
  digits.erase(0, zeros);
  // Keep the digits down to 1e-6, and the next one for rounding.
  const int64_t num_kept = static_cast<int64_t>(digits.size()) + exponent + 6;
  if (num_kept > 18) return false;
  int64_t value = 0;
  for (int64_t i = 0; i < num_kept; ++i) {
    value = 10 * value + (i < static_cast<int64_t>(digits.size()) ? digits[i] - '0' : 0);
  }
  if (num_kept >= 0 && num_kept < static_cast<int64_t>(digits.size()) && digits[num_kept] >= '5') ++value;
  *utime = negative ? -value : value;
  return true;
}

TimeUnit GuessTimeUnit(const std::vector<std::string>& times, const std::string& head) {
  if (const auto said = UnitInHead(head)) return *said;
  std::vector<double> values;
  bool whole = true, fraction = false;  // no decimal point; decimals other than zero
  for (const std::string& text : times) {
    double value = 0;
    if (!ParseNumber(text, &value) || !std::isfinite(value)) continue;
    values.push_back(value);
    whole = whole && text.find_first_of(".eE") == std::string::npos;
    fraction = fraction || value != std::floor(value);
  }
  if (values.empty()) return TimeUnit::kSeconds;
  constexpr TimeUnit kUnits[] = {TimeUnit::kSeconds, TimeUnit::kMilliseconds, TimeUnit::kMicroseconds,
                                 TimeUnit::kNanoseconds};
  const double step = MedianStep(values);
  for (const TimeUnit unit : kUnits) {
    const double first = Seconds(values[0], unit);
    if (first >= kEarliest && first <= kLatest && Seconds(step, unit) <= kLongestStep) return unit;
  }
  if (step <= (whole ? kLongestPhotoStep : fraction ? kLongestGap : kLongestStep)) return TimeUnit::kSeconds;
  for (const TimeUnit unit : {TimeUnit::kMilliseconds, TimeUnit::kMicroseconds}) {
    if (Seconds(step, unit) <= kLongestVideoStep) return unit;
  }
  return TimeUnit::kNanoseconds;
}

}  // namespace mapmend

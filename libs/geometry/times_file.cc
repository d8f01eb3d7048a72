#include "libs/geometry/times_file.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <stdexcept>

#include "libs/base/text_table.h"

namespace mapmend {
namespace {

constexpr int64_t kEarliest = 630000000000000, kLatest = 4200000000000000;  // 1990 and 2103, microseconds
constexpr int64_t kNoTime = 100000000000000000;                             // the year 5138: another unit than it seems

bool IsWhole(const std::string& field) {
  return !field.empty() && field.find_first_not_of("0123456789") == std::string::npos;
}

std::string Quoted(const std::string& text) { return std::string(1, '"').append(text, 0, 60).append(1, '"'); }

class Reader {
 public:
  Reader(const std::string& path, const TextTable& table, NotGrowing not_growing)
      : path_(path), table_(table), not_growing_(not_growing) {
    num_columns_ = std::numeric_limits<size_t>::max();
    for (const TextRow& row : table.rows) num_columns_ = std::min(num_columns_, row.fields.size());
  }

  FrameTimes Read() {
    RefuseDates();
    RefuseDecimalCommas();
    const size_t column = TimeColumn();
    FrameTimes times;
    std::vector<std::string> texts;
    for (const TextRow& row : table_.rows) {
      double ignored = 0;
      if (!ParseNumber(row.fields[column], &ignored)) Fail(row, Quoted(row.fields[column]) + " is not a time");
      texts.push_back(row.fields[column]);
    }
    times.unit = GuessTimeUnit(texts, table_.HeadOf(column));
    for (size_t i = 0; i < texts.size(); ++i) Append(table_.rows[i], texts[i], &times);
    if (const auto names = NameColumn()) {
      for (const TextRow& row : table_.rows) times.names.push_back(row.fields[*names]);
    }
    if (times.unit != TimeUnit::kSeconds) times.note = std::string("in ") + NameOf(times.unit);
    if (column > 0) times.note += (times.note.empty() ? "from column " : ", column ") + std::to_string(column + 1);
    if (!times.note.empty()) times.note = "times " + path_ + ": read " + times.note;
    if (num_back_ > 0) {
      times.note += (times.note.empty() ? "times " + path_ + ": " : "; ") + std::to_string(num_back_) +
                    (num_back_ == 1 ? " line is" : " lines are") + " not later than the one before";
    }
    return times;
  }

 private:
  [[noreturn]] void Fail(const TextRow& row, const std::string& problem) const {
    throw std::runtime_error("times file " + path_ + ", line " + std::to_string(row.line) + ": " + problem);
  }

  void Append(const TextRow& row, const std::string& text, FrameTimes* times) {
    int64_t utime = 0;
    const bool fits = ParseTime(text, times->unit, &utime);
    if (!fits || std::abs(utime) > kNoTime) {
      Fail(row, Quoted(text) + " is no time in " + NameOf(times->unit) +
                    ", the unit of the file; a first line such as \"# [ns]\" names another (s, ms, us, ns)");
    }
    if (!times->utimes.empty() && utime <= last_ && ++num_back_ > MaxBack()) {
      Fail(row, Quoted(text) + " is not later than the time before; take the frame and its line out");
    }
    times->utimes.push_back(utime);
    last_ = times->utimes.size() == 1 ? utime : std::max(last_, utime);
  }

  // A file of some length may hold a few.
  int MaxBack() const {
    constexpr int kSome = 10, kShare = 20;
    const int count = static_cast<int>(table_.rows.size());
    return not_growing_ == NotGrowing::kRefuse || count < kSome ? 0 : std::max(1, count / kShare);
  }

  void RefuseDates() const {
    for (const TextRow& row : table_.rows) {
      const std::string& f = row.fields[0];
      if (f.size() >= 10 && f[4] == '-' && f[7] == '-' && IsWhole(f.substr(0, 4)) && IsWhole(f.substr(5, 2)))
        Fail(row, Quoted(f) + " is a date; give seconds, e.g. those since 1970");
    }
  }

  // "1525003606,5": two columns of whole numbers throughout, unless they can be a time and something else.
  void RefuseDecimalCommas() const {
    const auto is_comma = [](const std::string& field) {
      const size_t comma = field.find(',');
      return comma != std::string::npos && IsWhole(field.substr(0, comma)) && IsWhole(field.substr(comma + 1));
    };
    for (const TextRow& row : table_.rows) {
      if (is_comma(row.fields[0])) FailComma(row, row.fields[0]);
    }
    if (table_.separator != ',') return;
    for (const TextRow& row : table_.rows) {
      if (row.fields.size() != 2 || !IsWhole(row.fields[0]) || !IsWhole(row.fields[1])) return;
    }
    if (Counts(0) && Grows(1)) return;
    const bool named = table_.head.find(',') != std::string::npos;
    if (Grows(0) && (Counts(1) || named || table_.rows[0].fields[0].size() > 11)) return;  // 11: not seconds
    FailComma(table_.rows[0], table_.rows[0].fields[0] + "," + table_.rows[0].fields[1]);
  }
  [[noreturn]] void FailComma(const TextRow& row, const std::string& text) const {
    Fail(row, Quoted(text) + " looks like a number with a decimal comma; write a point");
  }

  bool IsNumeric(size_t column) const {
    double ignored = 0;
    return std::all_of(table_.rows.begin(), table_.rows.end(),
                       [&](const TextRow& row) { return ParseNumber(row.fields[column], &ignored); });
  }

  bool Grows(size_t column) const {
    long double last = -std::numeric_limits<long double>::infinity();
    for (const TextRow& row : table_.rows) {
      char* end = nullptr;
      const long double value = std::strtold(row.fields[column].c_str(), &end);  // 19 digits: nanoseconds of our days
      if (*end != '\0' || !(value > last)) return false;
      last = value;
    }
    return true;
  }

  // Whole numbers, each one more than the one before.
  bool Counts(size_t column) const {
    long last = -1;
    for (const TextRow& row : table_.rows) {
      const std::string& field = row.fields[column];
      if (!IsWhole(field) || field.size() > 9) return false;
      const long value = std::stol(field);
      if (last >= 0 && value != last + 1) return false;
      last = value;
    }
    return table_.rows.size() > 1;
  }

  bool IsOfOurDays(size_t column) const {
    std::vector<std::string> texts;
    for (const TextRow& row : table_.rows) texts.push_back(row.fields[column]);
    const TimeUnit unit = GuessTimeUnit(texts, table_.HeadOf(column));
    return std::all_of(texts.begin(), texts.end(), [&](const std::string& text) {
      int64_t utime = 0;
      return ParseTime(text, unit, &utime) && utime >= kEarliest && utime <= kLatest;
    });
  }

  // The first column, unless it holds names or whole numbers beside real times.
  size_t TimeColumn() const {
    size_t first = 0;
    while (first < num_columns_ && !IsNumeric(first)) ++first;
    if (first >= num_columns_) return 0;
    if (first > 0 && !Grows(first)) return 0;
    const bool may_be_index = std::all_of(table_.rows.begin(), table_.rows.end(), [&](const TextRow& row) {
      return IsWhole(row.fields[first]) && row.fields[first].size() <= 8;
    });
    if (!may_be_index) return first;
    for (size_t other = first + 1; other < num_columns_; ++other) {
      if (!IsNumeric(other)) continue;
      // Poses have more than four columns, and one that moves along an axis looks like a time.
      if (Grows(other) && (IsOfOurDays(other) || (Counts(first) && num_columns_ <= 4))) return other;
    }
    return first;
  }

  std::optional<size_t> NameColumn() const {
    for (size_t column = 0; column < num_columns_; ++column) {
      const bool names = std::all_of(table_.rows.begin(), table_.rows.end(), [&](const TextRow& row) {
        return !std::filesystem::path(row.fields[column]).extension().empty();
      });
      if (names && !IsNumeric(column)) return column;
    }
    return std::nullopt;
  }

  const std::string& path_;
  const TextTable& table_;
  const NotGrowing not_growing_;
  int64_t last_ = 0;  // of the times, the latest
  int num_back_ = 0;
  size_t num_columns_ = 0;  // that every line has
};

}  // namespace

FrameTimes ReadFrameTimes(const std::string& path, NotGrowing not_growing) {
  const TextTable table = ReadTextTable(path, "times file");
  if (table.rows.empty()) throw std::runtime_error("times file " + path + ": holds no time");
  return Reader(path, table, not_growing).Read();
}

std::optional<FrameTimes> TimesOfNames(const std::vector<std::string>& names) {
  if (names.empty()) return std::nullopt;
  FrameTimes times;
  std::vector<std::string> stems;
  for (const std::string& name : names) stems.push_back(std::filesystem::path(name).stem().string());
  times.unit = GuessTimeUnit(stems, "");
  for (const std::string& stem : stems) {
    int64_t utime = 0;
    const bool is_time = stem.find_first_not_of("0123456789.") == std::string::npos &&
                         ParseTime(stem, times.unit, &utime) && utime >= kEarliest && utime <= kLatest;
    if (!is_time || (!times.utimes.empty() && utime <= times.utimes.back())) return std::nullopt;
    times.utimes.push_back(utime);
  }
  times.names = names;
  return times;
}

}  // namespace mapmend

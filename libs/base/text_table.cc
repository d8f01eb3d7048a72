#include "libs/base/text_table.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string_view>

#include "libs/base/write_file.h"

namespace mapmend {
namespace {

constexpr std::string_view kBlank = " \t\r\f\v";

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

std::string Unquoted(std::string_view field) {
  field = Trim(field);
  if (field.size() >= 2 && (field.front() == '"' || field.front() == '\'') && field.back() == field.front()) {
    field = Trim(field.substr(1, field.size() - 2));
  }
  return std::string(field);
}

std::vector<std::string> Split(std::string_view line, char separator, bool is_head = false) {
  const std::string_view separators = separator == ';' ? ";" : separator == ',' ? "," : kBlank;
  std::vector<std::string> fields;
  for (line = Trim(line); !line.empty();) {
    const size_t end = std::min(line.find_first_of(separators), line.size());
    const std::string_view field = Trim(line.substr(0, end));
    if (separator == ',' && !is_head && field.find_first_of(kBlank) != std::string_view::npos && field.front() != '"') {
      for (std::string& part : Split(field, ' ')) fields.push_back(std::move(part));  // "1.0, 2 3"
    } else if (separator != ' ' || !field.empty()) {
      fields.push_back(Unquoted(field));
    }
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  while (!fields.empty() && fields.back().empty()) fields.pop_back();  // "1.0,2.0,"
  return fields;
}

// Names of columns: no number among them, and either no digit at all or a word for time.
bool IsHead(const std::vector<std::string>& fields) {
  double ignored = 0;
  bool digit = false, time = fields[0] == "t";
  for (const std::string& field : fields) {
    if (ParseNumber(field, &ignored)) return false;
    digit = digit || field.find_first_of("0123456789") != std::string::npos;
    time = time || field.find("ime") != std::string::npos || field.find("stamp") != std::string::npos;
  }
  return time || !digit;
}

}  // namespace

std::string TextTable::HeadOf(size_t column) const {
  const std::vector<std::string> names = Split(head, separator, /*is_head=*/true);
  const bool one_each = separator == ' ' ? !rows.empty() && names.size() == rows[0].fields.size() : names.size() > 1;
  if (!one_each) return head;
  return column < names.size() ? names[column] : "";
}

TextTable ReadTextTable(const std::string& path, const std::string& what) {
  std::string content = ReadFile(path);
  const auto fail = [&](const char* problem) { throw std::runtime_error(what + " " + path + ": " + problem); };
  if (content.starts_with("\xEF\xBB\xBF")) content.erase(0, 3);
  if (content.starts_with("\xFF\xFE") || content.starts_with("\xFE\xFF")) fail("is UTF-16 text; save it as UTF-8");
  if (content.find('\0') != std::string::npos) fail("is not a text file");
  if (content.find('\n') == std::string::npos) std::replace(content.begin(), content.end(), '\r', '\n');

  TextTable table;
  std::vector<std::pair<int, std::string_view>> lines;
  std::string_view rest = content;
  for (int number = 1; !rest.empty(); ++number) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = Trim(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line.empty()) continue;
    if (line[0] != '#' && line[0] != '%')
      lines.emplace_back(number, line);
    else if (lines.empty())
      table.head = std::string(Trim(line.substr(std::min(line.find_first_not_of("#% "), line.size()))));
  }
  if (lines.empty()) return table;
  const std::string_view sample = lines.size() > 1 ? lines[1].second : lines[0].second;  // the first may be a head
  table.separator = sample.find(';') != std::string_view::npos   ? ';'
                    : sample.find(',') != std::string_view::npos ? ','
                                                                 : ' ';
  for (const auto& [number, line] : lines) {
    TextRow row{number, Split(line, table.separator)};
    if (row.fields.empty()) continue;
    if (table.rows.empty() && lines.size() > 1 && number == lines[0].first && IsHead(row.fields)) {
      table.head = std::string(line);
      continue;
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

bool ParseNumber(const std::string& field, double* value) {
  const char* begin = field.data() + (field.starts_with('+') ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, field.data() + field.size(), *value);
  return error == std::errc() && end == field.data() + field.size();
}

}  // namespace mapmend

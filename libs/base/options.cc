#include "libs/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>

#include "libs/base/nearest_word.h"

namespace mapmend {
namespace {

constexpr char kNone[] = "none";  // an optional without a value

template <typename Number>
std::string NumberText(Number x) {
  if constexpr (std::is_floating_point_v<Number>) {
    constexpr double kWhole = 1e15;  // 100000 rather than 1e+05
    if (std::abs(x) < kWhole && x == std::floor(x)) return NumberText(static_cast<int64_t>(x));
  }
  char buffer[64];
  const std::to_chars_result end = std::to_chars(buffer, buffer + sizeof(buffer), x);
  return std::string(buffer, end.ptr);
}

std::string Trimmed(const std::string& text) {
  const size_t begin = text.find_first_not_of(" \t"), end = text.find_last_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
}

// The elements of "16, 8, 5" or "[16, 8, 5]".
std::vector<std::string> Split(std::string text) {
  if (text.size() >= 2 && text.front() == '[' && text.back() == ']') text = Trimmed(text.substr(1, text.size() - 2));
  std::vector<std::string> parts;
  if (text.empty()) return parts;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(Trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

// Each returns an empty string, or what is wrong.
template <typename Number>
std::string Parse(const std::string& text, Number* value) {
  Number parsed{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error == std::errc::result_out_of_range) return "'" + text + "' is too large a number";
  if (error != std::errc() || end != text.data() + text.size())
    return "'" + text + (std::is_floating_point_v<Number> ? "' is not a number" : "' is not a whole number");
  *value = parsed;
  return "";
}

std::string Parse(const std::string& text, bool* value) {
  if (text != "true" && text != "false") return "'" + text + "' is neither true nor false";
  *value = text == "true";
  return "";
}

std::string Parse(const std::string& text, std::string* value) {
  *value = text;
  return "";
}

template <typename Number>
std::string Parse(const std::string& text, std::vector<Number>* values) {
  std::vector<Number> parsed;
  for (const std::string& part : Split(text)) {
    if (const std::string error = Parse(part, &parsed.emplace_back()); !error.empty()) return error;
  }
  *values = parsed;
  return "";
}

std::string Parse(const std::string& text, std::optional<uint64_t>* value) {
  if (text == kNone) {
    value->reset();
    return "";
  }
  uint64_t number = 0;
  const std::string error = Parse(text, &number);
  if (error.empty()) *value = number;
  return error;
}

std::string TextOf(bool value) { return value ? "true" : "false"; }
std::string TextOf(const std::string& value) { return value; }
std::string TextOf(const std::optional<uint64_t>& value) { return value ? NumberText(*value) : kNone; }
template <typename Number>
std::string TextOf(const std::vector<Number>& values) {
  std::string text;
  for (const Number value : values) text += (text.empty() ? "" : ", ") + NumberText(value);
  return text;
}
template <typename Number>
std::string TextOf(Number value) {
  return NumberText(value);
}

std::string MustBe(const Range& range) {
  const bool is_closed =
      std::isfinite(range.lo) && std::isfinite(range.hi) && !range.is_open_below && !range.is_open_above;
  return (is_closed ? "must lie in " : "must be ") + range.Describe();
}

std::string CheckValue(const Range& range, double value) { return range.Contains(value) ? "" : MustBe(range); }
template <typename Number>
std::string CheckValue(const Range& range, const std::vector<Number>& values) {
  for (const Number value : values) {
    if (std::string error = CheckValue(range, static_cast<double>(value)); !error.empty()) return "each " + error;
  }
  return "";
}

nlohmann::ordered_json JsonOf(const Option& option) {
  return std::visit(
      [](const auto* member) -> nlohmann::ordered_json {
        using Value = std::decay_t<decltype(*member)>;
        if constexpr (std::is_same_v<Value, std::optional<uint64_t>>) {
          return *member ? nlohmann::ordered_json(**member) : nlohmann::ordered_json();
        } else if constexpr (std::is_same_v<Value, double>) {
          return std::isfinite(*member) ? nlohmann::ordered_json(*member) : nlohmann::ordered_json(NumberText(*member));
        } else {
          return *member;
        }
      },
      option.member);
}

// As YAML takes it.
std::string YamlOf(const Option& option) {
  if (const auto* text = std::get_if<std::string*>(&option.member)) return nlohmann::json(**text).dump();
  const bool is_list = std::holds_alternative<std::vector<int>*>(option.member) ||
                       std::holds_alternative<std::vector<double>*>(option.member);
  return is_list ? "[" + option.Text() + "]" : option.Text();
}

std::string DescribeKind(const Option& option) {
  std::string text = option.range ? option.range->Describe() : "";
  if (std::holds_alternative<bool*>(option.member)) text = "true or false";
  if (std::holds_alternative<std::string*>(option.member)) text = "text";
  if (std::holds_alternative<uint64_t*>(option.member)) text = "whole number";
  if (std::holds_alternative<std::optional<uint64_t>*>(option.member)) text = "whole number, or none";
  return text;
}

std::vector<std::string> Groups(const std::string& name) {
  std::vector<std::string> groups;
  for (size_t begin = 0, dot; (dot = name.find('.', begin)) != std::string::npos; begin = dot + 1)
    groups.push_back(name.substr(begin, dot - begin));
  return groups;
}

std::string LastPart(const std::string& name) { return name.substr(name.rfind('.') + 1); }

// Up to three names that may have been meant: those that end in the given one, else the nearest by letters.
std::vector<std::string> NearestNames(const std::string& name, const std::vector<std::string>& names) {
  constexpr size_t kMost = 3;
  std::vector<std::string> found;
  for (const std::string& candidate : names) {
    if (candidate.ends_with("." + name) || LastPart(candidate) == LastPart(name)) found.push_back(candidate);
  }
  // "loop.gap" for "graph.loops.gap" and for whatever else has a gap: the most alike are named.
  if (found.size() > kMost) {
    if (const std::string nearest = NearestWord(name, found); !nearest.empty()) return {nearest};
    found.resize(kMost);
  }
  if (!found.empty()) return found;
  if (const std::string nearest = NearestWord(name, names); !nearest.empty()) return {nearest};
  // The last part misspelt, and the groups left out.
  std::vector<std::string> last_parts;
  last_parts.reserve(names.size());
  for (const std::string& candidate : names) last_parts.push_back(LastPart(candidate));
  const std::string nearest = NearestWord(LastPart(name), last_parts);
  for (size_t i = 0; i < names.size() && !nearest.empty() && found.size() < kMost; ++i) {
    if (last_parts[i] == nearest) found.push_back(names[i]);
  }
  return found;
}

}  // namespace

std::string Range::Describe() const {
  const bool has_lo = std::isfinite(lo), has_hi = std::isfinite(hi);
  if (has_lo && has_hi && !is_open_below && !is_open_above) return NumberText(lo) + " to " + NumberText(hi);
  std::string text;
  if (has_lo) text = (is_open_below ? "more than " : "at least ") + NumberText(lo);
  if (has_hi)
    text += (text.empty() ? "" : ", ") + std::string(is_open_above ? "less than " : "at most ") + NumberText(hi);
  return text.empty() ? "any" : text;
}

std::string Option::Text() const {
  return std::visit([](const auto* value) { return TextOf(*value); }, member);
}

std::string Option::Set(const std::string& text) const {
  return std::visit(
      [&](auto* value) -> std::string {
        const auto before = *value;
        std::string error = Parse(Trimmed(text), value);
        if (error.empty()) error = Check();
        if (!error.empty()) *value = before;
        return error;
      },
      member);
}

std::string Option::Check() const {
  if (!range) return "";
  return std::visit(
      [&](const auto* value) -> std::string {
        using Value = std::decay_t<decltype(*value)>;
        if constexpr (std::is_same_v<Value, std::string> || std::is_same_v<Value, std::optional<uint64_t>>) {
          return "";
        } else {
          return CheckValue(*range, *value);
        }
      },
      member);
}

const Option* OptionList::Find(const std::string& name) const {
  const auto found = std::find_if(options_.begin(), options_.end(), [&](const Option& o) { return o.name == name; });
  return found == options_.end() ? nullptr : &*found;
}

bool OptionList::IsGroup(const std::string& name) const {
  return std::any_of(options_.begin(), options_.end(), [&](const Option& o) { return o.name.starts_with(name + "."); });
}

std::string OptionList::Check() const {
  for (const Option& option : options_) {
    if (const std::string error = option.Check(); !error.empty())
      return option.name + " = " + option.Text() + ": " + error;
  }
  for (const Group& group : groups_) {
    const std::string error = group.conflict();
    if (error.empty()) continue;
    return group.prefix.empty() ? error : group.prefix.substr(0, group.prefix.size() - 1) + ": " + error;
  }
  return "";
}

void OptionList::Set(const std::string& name, const std::string& text, const std::string& prefix) const {
  if (const Option* option = Find(name)) {
    if (const std::string error = option->Set(text); !error.empty())
      throw OptionError(prefix + option->name + " = " + text + ": " + error);
    return;
  }
  std::vector<std::string> names;
  names.reserve(options_.size());
  for (const Option& option : options_) {
    if (option.name.starts_with(name + "."))
      throw OptionError(prefix + name + ": is a group of options, such as " + prefix + option.name);
    names.push_back(option.name);
  }
  std::string meant;
  for (const std::string& nearest : NearestNames(name, names)) {
    if (!meant.empty()) meant += " or ";
    meant.append(prefix).append(nearest);
  }
  throw OptionError(prefix + name + ": no such option" + (meant.empty() ? "" : "; did you mean " + meant + "?"));
}

std::string ToJson(const OptionList& options) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const Option& option : options.options()) json[option.name] = JsonOf(option);
  return json.dump();
}

std::string ChangesToJson(const OptionList& options, const OptionList& defaults) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const Option& option : options.options()) {
    const Option* usual = defaults.Find(option.name);
    if (usual == nullptr || usual->Text() != option.Text()) json[option.name] = JsonOf(option);
  }
  return json.dump();
}

std::string ToYaml(const OptionList& options, const OptionList& defaults, const std::string& section) {
  std::string yaml;
  std::vector<std::string> open;  // groups
  for (const Option& option : options.options()) {
    const std::string name = (section.empty() ? "" : section + ".") + option.name;
    const std::vector<std::string> groups = Groups(name);
    const auto differs = std::mismatch(open.begin(), open.end(), groups.begin(), groups.end());
    open.erase(differs.first, open.end());
    for (size_t i = open.size(); i < groups.size(); ++i) {
      yaml += std::string(2 * i, ' ') + groups[i] + ":\n";
      open.push_back(groups[i]);
    }
    std::string line = std::string(2 * open.size(), ' ') + LastPart(name) + ": " + YamlOf(option);
    constexpr size_t kCommentColumn = 40;
    line.resize(std::max(line.size() + 2, kCommentColumn), ' ');
    line += "# " + DescribeKind(option) + (option.unit.empty() ? "" : "; " + option.unit);
    const Option* usual = defaults.Find(option.name);
    if (usual != nullptr && usual->Text() != option.Text()) line += "; default " + YamlOf(*usual);
    yaml += line + "\n";
  }
  return yaml;
}

std::string ToMarkdown(const OptionList& defaults, const std::string& section) {
  std::string table = "| option | default | may be | unit |\n|---|---|---|---|\n";
  for (const Option& option : defaults.options()) {
    table += "| " + (section.empty() ? "" : section + ".") + option.name + " | " + option.Text() + " | " +
             DescribeKind(option) + " | " + option.unit + " |\n";
  }
  return table;
}

}  // namespace mapmend

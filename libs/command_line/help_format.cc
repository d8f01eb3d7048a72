#include "libs/command_line/help_format.h"

#include <CLI/CLI.hpp>
#include <map>

namespace mapmend {
namespace {

// What a text is, by the name of its option: every program uses a name for the same thing.
std::string TextKind(const CLI::Option& option) {
  static const std::map<std::string, std::string> kKinds = {{"camera", "FILE"},
                                                            {"times", "FILE"},
                                                            {"vocabulary", "FILE"},
                                                            {"groundtruth", "FILE"},
                                                            {"mask", "FILE"},
                                                            {"events", "FILE"},
                                                            {"outbox", "FILE"},
                                                            {"profile", "FILE"},
                                                            {"db", "FILE"},
                                                            {"video", "FILE"},
                                                            {"truth", "FILE"},
                                                            {"out", "FOLDER"},
                                                            {"record", "FOLDER"},
                                                            {"lcm-url", "URL"},
                                                            {"session", "UUID"},
                                                            {"skip-frames", "A-B,..."},
                                                            {"bind", "ADDRESS"},
                                                            {"channel-prefix", "WORD"},
                                                            {"vehicle", "NAME"},
                                                            {"title", "TEXT"},
                                                            {"gps", "FILE"},
                                                            {"gps-origin", "LAT,LON,ALTITUDE"},
                                                            {"groundtruth-origin", "LAT,LON,ALTITUDE"},
                                                            {"source", "URL"},
                                                            {"image-channel", "NAME"},
                                                            {"images", "full|none|N"},
                                                            {"format", "NAME,..."},
                                                            {"token-file", "FILE"},
                                                            {"station", "HOST[:PORT]"},
                                                            {"picture", "FILE"},
                                                            {"json", "FILE"},
                                                            {"bounds", "W,S,E,N"}};
  for (const std::string& name : option.get_lnames()) {
    if (const auto found = kKinds.find(name); found != kKinds.end()) return found->second;
  }
  return option.get_positional() ? "" : "TEXT";
}

// "INT:INT in [1 - 100000]" as CLI11 has it, "N (1 to 100000)".
std::string Kind(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const size_t colon = type.find(':');
  const std::string name = type.substr(0, colon);
  std::string check = colon == std::string::npos ? "" : type.substr(colon + 1);
  std::string kind = name;
  if (name == "INT" || name == "UINT") kind = "N";
  if (name == "FLOAT") kind = "X";
  if (name == "TEXT") kind = TextKind(option);
  if (check.starts_with("{")) return check.substr(1, check.size() - 2);  // one of these words
  if (check == "POSITIVE") check = "more than 0";
  if (check == "NONNEGATIVE") check = "0 or more";
  if (const size_t open = check.find('['), dash = check.find(" - "), close = check.find(']');
      open != std::string::npos && dash != std::string::npos && close != std::string::npos) {
    check = check.substr(open + 1, dash - open - 1) + " to " + check.substr(dash + 3, close - dash - 3);
  }
  return kind + (check.empty() ? "" : (kind.empty() ? "(" : " (") + check + ")");
}

}  // namespace

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  if (!option->get_option_text().empty() || option->get_type_size() == 0) return Formatter::make_option_opts(option);
  std::string text;
  const std::string kind = Kind(*option);
  if (!kind.empty()) text += " " + kind;
  if (!option->get_default_str().empty()) text += " [" + option->get_default_str() + "]";
  if (option->get_expected_max() >= CLI::detail::expected_max_vector_size) text += " ...";
  if (option->get_required()) text += " (required)";
  return text;
}

}  // namespace mapmend

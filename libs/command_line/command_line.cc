#include "libs/command_line/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "libs/base/nearest_word.h"
#include "libs/command_line/help_format.h"

namespace mapmend {
namespace {

std::vector<CLI::App*> AllSubcommands(CLI::App* app) {
  return app->get_subcommands([](CLI::App*) { return true; });
}

std::vector<std::string> SubcommandNames(CLI::App* app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : AllSubcommands(app)) names.push_back(sub->get_name());
  return names;
}

std::vector<std::string> OptionNames(CLI::App* app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app->get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::string DidYouMean(const std::string& word, const std::vector<std::string>& candidates) {
  const std::string nearest = NearestWord(word, candidates);
  return nearest.empty() ? "" : "; did you mean " + nearest + "?";
}

// What is wrong with the first word that a command did not take.
std::string DescribeExtra(CLI::App* app, const std::string& word) {
  if (word.starts_with("-")) return "no option " + word + DidYouMean(word, OptionNames(app));
  if (!AllSubcommands(app).empty()) return "no command '" + word + "'" + DidYouMean(word, SubcommandNames(app));
  return "'" + word + "' is one argument too many";
}

// CLI11's text in our words where its own are hard to read.
std::string Reword(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  const auto after = [&](const std::string& beginning) {
    return text.starts_with(beginning) ? text.substr(beginning.size()) : std::string();
  };
  if (const std::string rest = after("Could not convert: "); !rest.empty()) {
    const size_t equals = rest.find(" = ");
    if (equals != std::string::npos)
      return rest.substr(0, equals) + ": '" + rest.substr(equals + 3) + "' is not a number";
  }
  if (text == "A subcommand is required") return "a command is missing";
  if (text.ends_with(" is required"))
    return text.substr(0, text.size() - std::string(" is required").size()) + " is missing";
  if (const size_t at = text.find(": Value "); at != std::string::npos) text.replace(at, 8, ": ");
  if (const size_t at = text.find(": 1 required "); at != std::string::npos)
    return text.substr(0, at) + " needs a value";
  if (const size_t at = text.find(" excludes "); at != std::string::npos) text.replace(at, 10, " does not go with ");
  return text;
}

void ApplyToAll(CLI::App* app, const std::shared_ptr<CLI::FormatterBase>& formatter) {
  app->formatter(formatter);
  for (CLI::App* sub : AllSubcommands(app)) ApplyToAll(sub, formatter);
}

// The command that the line has got to, and the whole of its name.
struct Leaf {
  CLI::App* app;
  std::string name;
};

int TellMistake(CLI::App* app, const CLI::ParseError& error) {
  Leaf leaf{app, app->get_name()};
  std::string what;
  for (;;) {
    const std::vector<std::string> extras = leaf.app->remaining(false);
    // A word that nobody takes explains best what else is missing.
    if (!extras.empty() && !leaf.app->get_prefix_command()) what = DescribeExtra(leaf.app, extras.front());
    if (!what.empty() || leaf.app->get_subcommands().empty()) break;
    leaf.app = leaf.app->get_subcommands().front();
    leaf.name += " " + leaf.app->get_name();
  }
  if (what.empty()) what = Reword(error.what());
  std::cerr << ErrorPrefix(leaf.name) << what << " ('" << leaf.name << " --help' lists all)\n";
  return kExitUsage;
}

}  // namespace

std::string ProgramName(const std::string& own_name, int argc, char** argv) {
  const std::string called = argc > 0 ? argv[0] : "";
  return called.starts_with("mapmend ") ? called : own_name;
}

std::string ErrorPrefix(const std::string& program_name) {
  const size_t space = program_name.find(' ');
  if (space == std::string::npos) return program_name + ": ";
  return program_name.substr(0, space) + ": " + program_name.substr(space + 1) + ": ";
}

std::optional<int> ParseCommandLine(CLI::App* app, int argc, char** argv) {
  app->name(ProgramName(app->get_name(), argc, argv));
  ApplyToAll(app, std::make_shared<HelpFormat>());
  try {
    app->parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::Success& e) {  // help and version
    return app->exit(e);
  } catch (const CLI::RuntimeError& e) {
    return e.get_exit_code();
  } catch (const CLI::ParseError& e) {
    return TellMistake(app, e);
  }
}

}  // namespace mapmend

#include "libs/command_line/option_flags.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <iterator>
#include <utility>

#include "libs/base/options_file.h"
#include "libs/command_line/command_line.h"

namespace mapmend {
namespace {

std::string FirstPart(const std::string& name) { return name.substr(0, name.find('.')); }

// A name within a program, and what stood before it: "merger.search.max_proposals" and "search.max_proposals" are one
// option of the merger.
struct OwnName {
  std::string name, prefix;
};

OwnName SplitName(const std::string& name, const std::string& program) {
  if (!IsUnderProgram(name, program) || name == program) return {name, ""};
  return {name.substr(program.size() + 1), program + "."};
}

// A flag that prints the options in some form and ends the program. Without description it is not listed.
void AddPrintFlag(CLI::App* app, const std::string& flag, const std::string& description, const OptionList& options,
                  std::function<std::string()> print) {
  app->add_flag_function(
         flag,
         [options, print = std::move(print)](int64_t) {
           RequireGoodOptions(options);
           std::cout << print() << std::flush;
           throw CLI::Success();
         },
         description)
      ->group(description.empty() ? "" : "Options");
}

}  // namespace

bool IsUnderProgram(const std::string& name, const std::string& program) { return FirstPart(name) == program; }

bool IsUnderAnyProgram(const std::string& name) {
  return std::find(std::begin(kConfigurablePrograms), std::end(kConfigurablePrograms), FirstPart(name)) !=
         std::end(kConfigurablePrograms);
}

void ApplyOptionsFile(const std::string& path, const std::string& program, const OptionList& options) {
  std::string place;
  try {
    for (const OptionLine& line : ReadOptionsFile(path)) {
      if (IsUnderAnyProgram(line.name) && !IsUnderProgram(line.name, program)) continue;
      const OwnName own = SplitName(line.name, program);
      if (line.is_empty && (own.name == program || options.IsGroup(own.name))) continue;
      place = PlaceOf(path, line);
      options.Set(own.name, line.text, own.prefix);
    }
  } catch (const OptionError& e) {
    throw UsageError("--config " + place + e.what());
  }
}

void ApplySetting(const std::string& setting, const std::string& program, const OptionList& options) {
  const size_t equals = setting.find('=');
  if (equals == std::string::npos) throw UsageError("--set " + setting + ": expected NAME=VALUE");
  const OwnName own = SplitName(setting.substr(0, equals), program);
  try {
    options.Set(own.name, setting.substr(equals + 1), own.prefix);
  } catch (const OptionError& e) {
    throw UsageError(std::string("--set ") + e.what());
  }
}

void AddSettingFlags(CLI::App* app, const std::string& example, const std::string& lister,
                     std::function<void(const std::string& path)> on_file,
                     std::function<void(const std::string& setting)> on_setting) {
  app->add_option_function<std::string>("--config", std::move(on_file), "YAML file of options; may be given repeatedly")
      ->type_name("FILE")
      ->trigger_on_parse();
  app->add_option_function<std::string>(
         "--set", std::move(on_setting),
         "any option by its name, e.g. " + example + "; may be given repeatedly (" + lister + " lists all)")
      ->type_name("NAME=VALUE")
      ->trigger_on_parse();
}

void AddOptionFlags(CLI::App* app, const std::string& program, const OptionList& options, const OptionList& defaults) {
  const Option& example = defaults.options().front();
  AddSettingFlags(
      app, example.name + "=" + example.Text(), "--print-config",
      [=](const std::string& path) { ApplyOptionsFile(path, program, options); },
      [=](const std::string& setting) { ApplySetting(setting, program, options); });
  AddPrintFlag(app, "--print-config", "print all options with value, range and unit, as --config reads them, and end",
               options, [=] { return ToYaml(options, defaults, program); });
  // For mapmend, which starts the other programs.
  AddPrintFlag(app, "--print-changes", "", options, [=] { return ChangesToJson(options, defaults) + "\n"; });
  AddPrintFlag(app, "--print-table", "", options, [=] { return ToMarkdown(defaults, program); });
}

void RequireGoodOptions(const OptionList& options) {
  if (const std::string error = options.Check(); !error.empty()) throw UsageError(error);
}

}  // namespace mapmend

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "libs/base/options.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/process_settings.h"

namespace mapmend {
namespace {

// All options of one program, as YAML or as a table for the docs.
std::string Describe(const std::string& program, bool as_table) {
  if (program != "mapmend") return AskProgram(program, {as_table ? "--print-table" : "--print-config"});
  LauncherOptions launcher;
  const OptionList list = OptionList::Of(launcher);
  return as_table ? ToMarkdown(list, program) : ToYaml(list, list, program);
}

void Print(std::vector<std::string> programs, bool as_table) {
  if (programs.empty()) programs.assign(std::begin(kConfigurablePrograms), std::end(kConfigurablePrograms));
  std::string text;
  for (const std::string& program : programs) {
    if (as_table) text += (text.empty() ? "## " : "\n## ") + program + "\n\n";
    text += Describe(program, as_table);
  }
  std::fputs(text.c_str(), stdout);
}

}  // namespace

void AddOptionsCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "options", "List every option of every process with its default, what it may be, and its unit");
  const auto programs = std::make_shared<std::vector<std::string>>();
  const auto as_table = std::make_shared<bool>(false);
  sub->add_option("PROCESS", *programs,
                  "only these: frontend, hub, mapmend, merger, mosaic, submap_store, viewer_export")
      ->check(
          CLI::IsMember(std::vector<std::string>(std::begin(kConfigurablePrograms), std::end(kConfigurablePrograms))));
  sub->add_flag("--table", *as_table, "as tables in Markdown instead of YAML");
  sub->footer(
      "What it prints is a file for --config of all commands and processes; a file needs to hold what differs only.\n"
      "--set frontend.tracker.min_inliers=30 sets a single one. On the command line of a process itself, or in a file\n"
      "for it alone, the name of the process may be left out.");
  sub->callback([programs, as_table] { Print(*programs, *as_table); });
}

}  // namespace mapmend

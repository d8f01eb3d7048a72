// The command people type. Every subcommand is a file of its own: <x>_command.cc.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>

#include "libs/command_line/command_line.h"
#include "procs/mapmend/commands.h"

int main(int argc, char** argv) {
  CLI::App app("mapmend mends broken visual SLAM maps: submaps, an undirected connected graph, one merged map.",
               "mapmend");
  app.set_version_flag("--version", std::string("mapmend ") + MAPMEND_VERSION);
  app.require_subcommand(0, 1);
  app.footer(
      "`mapmend COMMAND --help` tells more; `mapmend demo` shows it at work on the bundled flight.\n"
      "Exit codes: 0 done, 1 an error, 2 a mistake in the command line; `mapmend run --help` tells the others.");
  mapmend::AddRunCommand(&app);
  mapmend::AddStationCommand(&app);
  mapmend::AddFlyCommand(&app);
  mapmend::AddDemoCommand(&app);
  mapmend::AddRecoverCommand(&app);
  mapmend::AddReplayCommand(&app);
  mapmend::AddPublishCommand(&app);
  mapmend::AddStatusCommand(&app);
  mapmend::AddCloseCommand(&app);
  mapmend::AddViewCommand(&app);
  mapmend::AddExportCommand(&app);
  mapmend::AddMosaicCommand(&app);
  mapmend::AddMergeCommand(&app);
  mapmend::AddCalibrateCommand(&app);
  mapmend::AddEdgesCommand(&app);
  mapmend::AddEvalCommand(&app);
  mapmend::AddSpyCommand(&app);
  mapmend::AddDoctorCommand(&app);
  mapmend::AddForwardCommands(&app);
  mapmend::AddVocabCommand(&app);
  mapmend::AddHubCommand(&app);
  mapmend::AddOptionsCommand(&app);
  // What goes on under way is for the log, stdout and stderr are for what a person asked (Backend opens the log).
  spdlog::set_level(spdlog::level::off);
  try {
    if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
    if (!app.get_subcommands().empty()) return 0;
    std::cerr << "mapmend: no command given\n\n" << app.help();
    return mapmend::kExitUsage;
  } catch (const mapmend::UsageError& e) {
    std::cerr << "mapmend: " << e.what() << "\n";
    return mapmend::kExitUsage;
  } catch (const std::exception& e) {
    std::cerr << "mapmend: " << e.what() << "\n";
    return 1;
  }
}

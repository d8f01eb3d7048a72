#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

// The subcommands of `mapmend`. Each Add<X>Command (in <x>_command.cc) adds one subcommand with its options to app; its
// callback runs after parsing, in the calling thread. A callback throws std::exception for an error (main prints one
// line and exits with 1) or CLI::RuntimeError(code) to end with that exit code, having said why itself.
namespace mapmend {

struct RunOptions;

void AddEvalCommand(CLI::App* app);
void AddEdgesCommand(CLI::App* app);
void AddExportCommand(CLI::App* app);
void AddMosaicCommand(CLI::App* app);
void AddMergeCommand(CLI::App* app);
void AddCalibrateCommand(CLI::App* app);
void AddForwardCommands(CLI::App* app);
void AddRunCommand(CLI::App* app);
void AddPublishCommand(CLI::App* app);
void AddReplayCommand(CLI::App* app);
void AddRecoverCommand(CLI::App* app);
void AddStatusCommand(CLI::App* app);
void AddCloseCommand(CLI::App* app);
void AddViewCommand(CLI::App* app);
void AddSpyCommand(CLI::App* app);
// The Java class path of lcm-spy. Throws std::runtime_error that says what is missing for it.
std::string SpyClassPath();
void AddDemoCommand(CLI::App* app);
void AddDoctorCommand(CLI::App* app);
void AddVocabCommand(CLI::App* app);
void AddVocabRecallCommand(CLI::App* vocab);  // part of AddVocabCommand
// Prints the options of all processes (libs/base/options.h).
void AddOptionsCommand(CLI::App* app);
void AddHubCommand(CLI::App* app);
void AddStationCommand(CLI::App* app);
void AddFlyCommand(CLI::App* app);

// The options that say what is flown and how it is tracked, INPUT included; in run_command.cc.
void AddFlightOptions(CLI::App* sub, RunOptions* options);

// One `mapmend NAME ARGUMENTS...` that is another program, or a subcommand of one: executes it with the arguments as
// they are.
struct ForwardCommand {
  std::string name;
  std::string program;         // found by FindProgram
  std::string first_argument;  // put before the arguments unless empty
  std::string description;
};

// Replaces this process by the program. Throws std::runtime_error if it cannot be found or started.
[[noreturn]] void ExecForward(const ForwardCommand& command, const std::vector<std::string>& arguments);

}  // namespace mapmend

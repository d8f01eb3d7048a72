#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

// What the command lines of all programs have in common: how they are read, how help looks, how a mistake is told.
namespace mapmend {

inline constexpr int kExitUsage = 2;  // the command line itself is wrong

// The command line asks for what does not go together. Programs end with kExitUsage.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// The name under which a program speaks: its own, or "mapmend db" where `mapmend` has started it under that name
// (argv[0]).
std::string ProgramName(const std::string& own_name, int argc, char** argv);
// The name as the beginning of an error line: "merger: ", "mapmend: db: ".
std::string ErrorPrefix(const std::string& program_name);

// Reads the command line and runs the callbacks of its subcommands. nullopt: go on. Otherwise the exit code to end
// with: help or version have been printed, a callback has thrown CLI::RuntimeError, or a mistake was told on stderr in
// one line that says which command it is, with the name that was perhaps meant:
//   mapmend: run: no option --camra; did you mean --camera? ('mapmend run --help' lists all)
// Other exceptions of callbacks pass.
std::optional<int> ParseCommandLine(CLI::App* app, int argc, char** argv);

}  // namespace mapmend

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "procs/mapmend/commands.h"
#include "procs/mapmend/paths.h"

namespace mapmend {
namespace {

const ForwardCommand kForwardCommands[] = {
    {"db", "submap_store", "",
     "Look into, check, repair, compact or merge map databases: info, check, repair, compact, forget, merge, hash"},
    {"simulate", "simulate", "", "Make a synthetic flight with exact ground truth"},
};

}  // namespace

void ExecForward(const ForwardCommand& command, const std::vector<std::string>& arguments) {
  const std::string path = FindProgram(command.program);
  std::vector<std::string> words = {"mapmend " + command.name};  // the name under which the program speaks
  if (!command.first_argument.empty()) words.push_back(command.first_argument);
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(path.c_str(), argv.data());
  throw std::runtime_error("cannot start " + path + ": " + std::strerror(errno));
}

void AddForwardCommands(CLI::App* app) {
  for (const ForwardCommand& command : kForwardCommands) {
    CLI::App* sub = app->add_subcommand(command.name, command.description);
    sub->set_help_flag();  // the program has its own
    sub->prefix_command();
    sub->callback([sub, command] { ExecForward(command, sub->remaining()); });
  }
}

}  // namespace mapmend

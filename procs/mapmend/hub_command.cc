#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "procs/mapmend/commands.h"
#include "procs/mapmend/paths.h"

namespace mapmend {

// The hub is a program of its own, without the libraries of this one; it keeps this one's name.
void AddHubCommand(CLI::App* app) {
  CLI::App* command =
      app->add_subcommand("hub", "Exchange messages between processes over TCP (stands in for LCM's TCPService)");
  command->set_help_flag();  // the program has its own
  command->prefix_command();
  command->callback([command] {
    const std::string program = FindProgram("hub");
    std::vector<std::string> words = {(ProgramFolder() / "mapmend").string(), "hub"};
    for (const std::string& word : command->remaining()) words.push_back(word);
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    execv(program.c_str(), argv.data());
    throw std::runtime_error("cannot start " + program + ": " + std::strerror(errno));
  });
}

}  // namespace mapmend

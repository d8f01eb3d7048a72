#pragma once

#include <atomic>
#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace mapmend {

// Options every process has: --lcm-url, --channel-prefix, --token-file, --log-level, --version. Adds them to app.
struct ProcessOptions {
  std::string lcm_url;  // as given; pass through ResolveLcmUrl
  std::string channel_prefix;
  std::string token_file;  // what a hub of another host wants to be shown
  std::string log_level = "info";
};
void AddProcessOptions(CLI::App* app, ProcessOptions* options);
// Reads the token file, if one is given, into the environment, where the bus of this process and of those that it
// starts find it (libs/bus/access_token.h). Throws std::runtime_error with one line. Call after parsing.
void ApplyTokenFile(const std::string& token_file);
// Sends the log to stderr, from the given level on; then the token file, as above. Call after parsing.
void ApplyLogLevel(const ProcessOptions& options);

// SIGINT and SIGTERM set a flag instead of killing the process; SIGPIPE is ignored. If the parent is mapmend's launcher
// (the environment variable MAPMEND_PARENT is set), the process also asks the kernel for SIGTERM when its parent dies.
void InstallSignalHandlers();
bool StopRequested();

// Runs body, turning any std::exception into "name: message" on stderr and exit code 1, a UsageError into exit code 2.
int RunMain(const std::string& name, int (*body)(int argc, char** argv), int argc, char** argv);

}  // namespace mapmend

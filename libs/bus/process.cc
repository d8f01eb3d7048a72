#include "libs/bus/process.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdlib>
#include <iostream>

#include "libs/base/stop_request.h"
#include "libs/bus/access_token.h"
#include "libs/command_line/command_line.h"

namespace mapmend {
namespace {

volatile std::sig_atomic_t g_stop_requested = 0;

void RequestStop(int) { g_stop_requested = 1; }

}  // namespace

void AddProcessOptions(CLI::App* app, ProcessOptions* options) {
  app->add_option("--lcm-url", options->lcm_url,
                  "LCM network, e.g. tcpq://127.0.0.1:7700 (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700)");
  app->add_option("--channel-prefix", options->channel_prefix,
                  "put before every channel name, so that runs can share a bus");
  app->add_option("--token-file", options->token_file,
                  "the token of a hub on another host, a copy of its file (default: the token in $MAPMEND_TOKEN)");
  app->add_option("--log-level", options->log_level, "debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  app->set_version_flag("--version", std::string("mapmend ") + MAPMEND_VERSION);
}

void ApplyLogLevel(const ProcessOptions& options) {
  // On stderr: stdout belongs to what a program was asked to print.
  static const auto logger = spdlog::stderr_color_mt("mapmend");
  spdlog::set_default_logger(logger);
  spdlog::set_level(spdlog::level::from_str(options.log_level));
  ApplyTokenFile(options.token_file);
}

void ApplyTokenFile(const std::string& token_file) {
  if (!token_file.empty()) setenv(kTokenEnvironment, ReadToken(token_file).c_str(), 1);
}

void InstallSignalHandlers() {
  struct sigaction action {};
  action.sa_handler = RequestStop;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  if (const char* parent = std::getenv("MAPMEND_PARENT"); parent != nullptr) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    // The parent may have died before the call above. The variable holds its pid, if it is a number.
    const long pid = std::strtol(parent, nullptr, 10);
    if (pid > 1 && getppid() != static_cast<pid_t>(pid)) g_stop_requested = 1;
  }
}

bool StopRequested() { return g_stop_requested != 0; }

void WithdrawStopRequest() { g_stop_requested = 0; }

int RunMain(const std::string& name, int (*body)(int argc, char** argv), int argc, char** argv) {
  const std::string prefix = ErrorPrefix(ProgramName(name, argc, argv));
  try {
    return body(argc, argv);
  } catch (const UsageError& e) {
    std::cerr << prefix << e.what() << "\n";
    return kExitUsage;
  } catch (const std::exception& e) {
    std::cerr << prefix << e.what() << "\n";
    return 1;
  }
}

}  // namespace mapmend

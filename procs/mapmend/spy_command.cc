#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <vector>

#include "libs/bus/bus.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/recorder.h"
#include "procs/mapmend/run_state.h"

namespace mapmend {
namespace {

std::string RequireJar(const std::string& path, const std::string& package) {
  if (access(path.c_str(), R_OK) != 0)
    throw std::runtime_error("lcm-spy needs " + path + ": install the package " + package);
  return path;
}

// The script lcm-spy does not start as Debian ships it (a removed JVM flag, a missing library): the class is started
// directly.
[[noreturn]] void ExecSpy(const std::string& url) {
  const std::string class_path = SpyClassPath();
  const std::string java = FindOnPath("java");
  std::vector<std::string> words = {java, "-cp", class_path, "lcm.spy.Spy", "-l", url};
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  execv(java.c_str(), argv.data());
  throw std::runtime_error("cannot start " + java + ": " + std::strerror(errno));
}

}  // namespace

std::string SpyClassPath() {
  const std::string how = "; `scripts/setup --spy` installs what it needs, then configure and build again";
  if (FindOnPath("java").empty()) throw std::runtime_error("lcm-spy needs Java (package default-jre)" + how);
  const std::string jars = RequireJar("/usr/share/java/lcm.jar", "liblcm-java" + how) + ":" +
                           RequireJar("/usr/share/java/jchart2d.jar", "libjchart2d-java" + how);
  const std::string types = FindData("java/mapmend-types.jar");
  if (types.empty()) throw std::runtime_error("mapmend-types.jar was not built (package ecj)" + how);
  if (std::getenv("DISPLAY") == nullptr)
    throw std::runtime_error("lcm-spy opens windows, and there is no X display (DISPLAY is not set)");
  return jars + ":" + types;
}

void AddSpyCommand(CLI::App* app) {
  CLI::App* sub =
      app->add_subcommand("spy", "Start lcm-spy with mapmend's message types: every channel, its rate, its fields");
  const auto url = std::make_shared<std::string>(), run = std::make_shared<std::string>();
  sub->add_option("RUN", *run, "folder of a run that goes on (its --out), to find its bus")
      ->excludes(
          sub->add_option("--lcm-url", *url, "LCM network (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700)"));
  sub->callback([url, run] {
    if (!run->empty() && !IsRunning(*run)) throw std::runtime_error(DescribeEnd(*run) + "; there is nothing to spy on");
    ExecSpy(run->empty() ? ResolveLcmUrl(*url) : ReadBusAddress(*run));
  });
}

}  // namespace mapmend

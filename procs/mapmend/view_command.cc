#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>

#include "libs/bus/process.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/map_file.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/page_access.h"
#include "procs/mapmend/run_state.h"

namespace mapmend {
namespace {

struct ViewOptions {
  MapFileOptions file;
  std::string map;
  std::optional<int> port;
};

// Until Ctrl-C, which is how one leaves.
void View(ViewOptions options) {
  InstallSignalHandlers();
  options.file.place = FindMap(options.map);
  if (!options.file.place.folder.empty() && IsRunning(options.file.place.folder))
    throw std::runtime_error(options.map + ": a run works there now, and has a live page of its own");
  const FreePort port(options.port.value_or(8080), options.port.has_value(), "--port");
  options.file.page_port = port.Port();
  try {
    MapFile map(options.file);
    const std::string page = DescribePage(options.file.page_bind, port.Port());
    std::printf("%s: %s (Ctrl-C ends it)\n", options.map.c_str(), page.substr(page.find("http")).c_str());
    std::fflush(stdout);
    for (;;) map.backend()->Tick(100);
  } catch (const Interrupted&) {
  }
}

}  // namespace

void AddViewCommand(CLI::App* app) {
  CLI::App* sub =
      app->add_subcommand("view", "Show a map that was made before on the live page: in the browser, until Ctrl-C");
  const auto options = std::make_shared<ViewOptions>();
  sub->add_option("MAP", options->map, "folder of results, or a map database")->required();
  sub->add_option("--port", options->port, "of the page (default: a free one from 8080 on)")
      ->check(CLI::Range(1, 65535));
  sub->add_option("--bind", options->file.page_bind,
                  "address on which the page listens; 0.0.0.0: everybody in the network sees it (default: this host "
                  "only)");
  sub->add_option("--vocabulary", options->file.vocabulary,
                  "the one that the flights were mapped with (default: mapmend's own)");
  options->file.settings.AddFlags(sub, {"hub", "submap_store", "viewer_export"});
  sub->footer(
      "Nothing of the map is changed: `mapmend edges disable` and `enable` overrule connections, `mapmend export` "
      "writes files.");
  sub->callback([options] {
    options->file.settings.Resolve();
    View(*options);
  });
}

}  // namespace mapmend

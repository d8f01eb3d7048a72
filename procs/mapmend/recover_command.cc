#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "libs/bus/process.h"
#include "libs/images/image_file.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/map_file.h"
#include "procs/mapmend/map_rescue.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"

namespace mapmend {
namespace {

void Recover(MapFileOptions options) {
  InstallSignalHandlers();
  Progress progress;
  try {
    const MapRescue rescue = RescueMap(options, true, [&](const std::string& line) { progress.Say(line); });
    const bool holds_images = std::filesystem::exists(SpoolPathFor(options.place.folder + "/outbox"));
    if (rescue.is_merged && !holds_images) {
      progress.Say("nothing to recover: " + options.place.db + " is complete, and so is its merged map");
      return;
    }
    options.with_merger = !rescue.is_merged;
    MapFile map(options);
    const std::string table = map.Finish([&](const std::string& text) { progress.Show(text); });
    for (const std::string& problem : map.Problems()) progress.Say(problem);
    progress.Say(table);
    if (!map.Problems().empty()) throw CLI::RuntimeError(kExitInputCutShort);
  } catch (const Interrupted&) {
    progress.Say("interrupted");
    throw CLI::RuntimeError(kExitInterrupted);
  }
}

}  // namespace

void AddRecoverCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "recover", "After a power cut or a kill: store what was left behind, end what is dead, make the map of it");
  const auto options = std::make_shared<MapFileOptions>();
  const auto results = std::make_shared<std::string>();
  sub->add_option("RESULTS", *results, "folder of the run (its --out)")->required();
  sub->add_option("--groundtruth", options->groundtruth, "TUM file; the report then tells the accuracy");
  sub->add_option("--vocabulary", options->vocabulary,
                  "the one that the flight was mapped with (default: mapmend's own)");
  options->exports.AddMosaicOption(sub);
  options->settings.AddFlags(sub, {"hub", "submap_store", "merger", "viewer_export", "mosaic"});
  sub->footer(
      "Exit codes: 0 done, also if there was nothing to do; 1 an error, told in one line (all is left as it was); 130\n"
      "interrupted (the same command goes on). `mapmend run ... --continue` does the same and goes on with the "
      "flight.");
  sub->callback([options, results] {
    options->settings.Resolve();
    options->place = FindMap(*results);
    if (options->place.folder.empty()) throw std::runtime_error(*results + ": give the folder of the run");
    options->out = options->place.folder;
    Recover(*options);
  });
}

}  // namespace mapmend

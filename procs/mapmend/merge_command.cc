#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/text_format.h"
#include "libs/bus/process.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/map_file.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_summary.h"

namespace mapmend {
namespace {

void Work(const MapFileOptions& options, const std::string& done) {
  InstallSignalHandlers();
  Progress progress;
  std::vector<std::string> problems;
  try {
    MapFile map(options);
    const std::string table = map.Finish([&](const std::string& text) { progress.Show(text); });
    progress.Say(table.empty() ? done : table);
    problems = map.Problems();
  } catch (const Interrupted&) {
    progress.Say("interrupted");
    throw CLI::RuntimeError(kExitInterrupted);
  }
  TellProblems(options.place, problems);  // the MapFile, while there is one, has stderr in its log
}

void AddCommonOptions(CLI::App* sub, std::string* map, MapFileOptions* options) {
  sub->add_option("MAP", *map, "folder of results, or a map database")->required();
  sub->add_option("--groundtruth", options->groundtruth,
                  "TUM file; the report then tells the accuracy (default: the one of the run that made the folder)");
  sub->add_option("--vocabulary", options->vocabulary,
                  "the one that the flights were mapped with (default: mapmend's own)");
  sub->add_option("--log-level", options->log_level, "of the log files in OUT/logs: debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  options->settings.AddFlags(sub, {"hub", "submap_store", "merger", "viewer_export", "mosaic"});
}

}  // namespace

void AddExportCommand(CLI::App* app) {
  CLI::App* sub =
      app->add_subcommand("export",
                          "Write the report, trajectories and point cloud of a map that was made before, also "
                          "in formats of other programs");
  const auto options = std::make_shared<MapFileOptions>();
  const auto map = std::make_shared<std::string>();
  AddCommonOptions(sub, map.get(), options.get());
  sub->add_option("--out", options->out, "folder of the results (default: MAP, if that is a folder)");
  options->exports.AddOptions(sub);
  sub->callback([options, map] {
    options->exports.Check();
    options->settings.Resolve();
    options->place = FindMap(*map);
    if (options->out.empty()) options->out = options->place.folder;
    if (options->out.empty()) throw std::runtime_error("give the folder for the results with --out");
    Work(*options, "");
  });
}

void AddMosaicCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "mosaic", "Make the picture of the ground again, finer, coarser or of a part, from the images of a map");
  const auto options = std::make_shared<MapFileOptions>();
  const auto map = std::make_shared<std::string>();
  AddCommonOptions(sub, map.get(), options.get());
  sub->add_option("--out", options->out, "folder of the results (default: MAP, if that is a folder)");
  sub->add_option_function<double>(
         "--gsd", [options](double gsd) { options->settings.Set(Format("viewer_export.mosaic.gsd=%.9g", gsd)); },
         "size of a pixel on the ground, metres, or map units without positions (default: that of the images)")
      ->check(CLI::Range(1e-9, 1e9));
  sub->add_option_function<std::string>(
      "--bounds",
      [options](const std::string& bounds) { options->settings.Set("viewer_export.mosaic.bounds=" + bounds); },
      "only this part: WEST,SOUTH,EAST,NORTH in the coordinates of mosaic.tif");
  sub->callback([options, map] {
    options->settings.Resolve();
    options->place = FindMap(*map);
    if (options->out.empty()) options->out = options->place.folder;
    if (options->out.empty()) throw std::runtime_error("give the folder for the results with --out");
    options->exports.mosaic = "final";
    Work(*options, "");
    const nlohmann::ordered_json summary = ReadSummary(options->out);
    const nlohmann::ordered_json mosaic = summary.value("mosaic", nlohmann::ordered_json::object());
    if (const std::string problem = mosaic.value("problem", ""); !problem.empty())
      throw std::runtime_error("no picture of the ground: " + problem);
    std::printf("%s/mosaic.tif: %d x %d pixels of %.4g %s, %d images\n", options->out.c_str(), mosaic.value("width", 0),
                mosaic.value("height", 0), mosaic.value("gsd", 0.0), mosaic.value("unit", "").c_str(),
                mosaic.value("images", 0));
  });
}

void AddMergeCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "merge", "Connect all submaps of a map database anew and refine the merged map, e.g. after `mapmend db merge`");
  const auto options = std::make_shared<MapFileOptions>();
  const auto map = std::make_shared<std::string>();
  AddCommonOptions(sub, map.get(), options.get());
  sub->add_option("--out", options->out,
                  "folder of the results (default: MAP, if that is a folder; else none are written)");
  sub->add_option("--seed", options->seed,
                  "of everything random (default: that of the flight's run, which gives the same map)");
  options->exports.AddMosaicOption(sub);
  sub->callback([options, map] {
    options->settings.Resolve();
    options->place = FindMap(*map);
    options->with_merger = true;
    if (options->out.empty()) options->out = options->place.folder;
    Work(*options, options->place.db + ": merged");
  });
}

}  // namespace mapmend

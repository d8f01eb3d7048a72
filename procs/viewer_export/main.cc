// viewer_export: follows a flight, shows it on a live page and writes the exports when the final map is there.

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/bus/access_token.h"
#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "libs/formats/map_formats.h"
#include "libs/geometry/read_trajectory.h"
#include "procs/viewer_export/edge_tool.h"
#include "procs/viewer_export/exporter.h"
#include "procs/viewer_export/live_page.h"
#include "procs/viewer_export/viewer.h"

namespace mapmend {
namespace {

// The command line as it is typed.
struct Arguments {
  ProcessOptions process;
  ViewerOptions viewer;
  std::vector<std::string> formats;
  double time_offset_s = 0;
  std::optional<double> time_tolerance_s;
  std::string ground_truth, times, truth_origin, report, token_file, picture = "edge.png";
  std::vector<std::string> edge;
};

void AddArguments(CLI::App* app, Arguments* arguments) {
  AddProcessOptions(app, &arguments->process);
  app->add_option("--out", arguments->viewer.out, "Directory for the exports (default: none are written)");
  app->add_option("--format", arguments->formats, "Formats to write beside those that always are, e.g. las,mcap");
  app->add_option("--frame", arguments->viewer.exports.frame, "Frame of reference of the exports")
      ->check(CLI::IsMember(FrameNames()))
      ->capture_default_str();
  app->add_option("--groundtruth", arguments->ground_truth, "trajectory to compare the map with");
  app->add_option("--times", arguments->times, "times of the frames, for a ground truth without times (KITTI)");
  app->add_option("--time-offset", arguments->time_offset_s, "seconds to add to the times of the ground truth");
  app->add_option("--time-tolerance", arguments->time_tolerance_s,
                  "largest difference in time of poses compared, seconds")
      ->check(CLI::Range(0.0, 1e6));
  app->add_option(
      "--groundtruth-origin", arguments->truth_origin,
      "LATITUDE,LONGITUDE,ALTITUDE of a ground truth that is east, north, up (default: the first position)");
  app->add_option("--port", arguments->viewer.page.port, "TCP port of the live page, 0 for none")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  app->add_option("--bind", arguments->viewer.page.bind, "Address on which the live page listens")
      ->capture_default_str();
  app->add_option("--files", arguments->viewer.page.files,
                  "Folder of results that the live page shows (default: --out)");
  app->add_option("--page-token-file", arguments->token_file,
                  "File with the secret that who switches connections on the page must know");
  app->add_flag("--stored", arguments->viewer.page.is_stored, "The map is finished: nothing more is expected");
  app->add_option("--report", arguments->report,
                  "Only make DIR/report.html again from DIR/summary.json and the pictures in DIR, then exit")
      ->type_name("DIR");
  auto* edge = app->add_option("--edge", arguments->edge,
                               "Only draw the connection of two submaps, SESSION:NUMBER each, as --picture")
                   ->expected(2);
  app->add_option("--picture", arguments->picture, "with --edge: the PNG file")->needs(edge);
  AddOptionFlags(app, "viewer_export", &arguments->viewer);
}

// What can be wrong with the arguments shows here, before anything is connected.
ViewerOptions CheckedOptions(const Arguments& arguments) {
  ViewerOptions options = arguments.viewer;
  if (arguments.time_tolerance_s) options.evaluation.tolerance_us = std::llround(*arguments.time_tolerance_s * 1e6);
  options.exports.formats = ParseFormats(arguments.formats);
  RequireGoodOptions(OptionList::Of(options));
  const std::string& truth = arguments.ground_truth;
  if (!arguments.truth_origin.empty()) {
    options.exports.ground_truth_origin = ParseGeodetic(arguments.truth_origin, "--groundtruth-origin");
  } else if (!truth.empty()) {
    options.exports.ground_truth_origin = FindOrigin(truth);
  }
  if (!truth.empty()) {
    options.ground_truth =
        GroundTruth{truth, ReadGroundTruth(truth, arguments.times, arguments.time_offset_s).poses, {}};
    options.ground_truth->options = options.evaluation;
  }
  if (options.page.files.empty()) options.page.files = options.out;
  if (!arguments.token_file.empty()) options.page.token = ReadToken(arguments.token_file);
  return options;
}

int Main(int argc, char** argv) {
  CLI::App app(
      "Shows the map while it grows and writes it out when it is final: trajectories, point cloud, graph, report.",
      "viewer_export");
  Arguments arguments;
  AddArguments(&app, &arguments);
  if (const auto code = ParseCommandLine(&app, argc, argv)) return *code;
  ApplyLogLevel(arguments.process);
  if (!arguments.report.empty()) {
    RebuildReport(arguments.report);
    return 0;
  }
  const auto connect = [&] {
    InstallSignalHandlers();
    return std::make_unique<Bus>(ResolveLcmUrl(arguments.process.lcm_url), arguments.process.channel_prefix);
  };
  if (const std::vector<std::string>& edge = arguments.edge; !edge.empty()) {
    ShowEdge(connect().get(), ParseSubmapKey(edge[0]), ParseSubmapKey(edge[1]), arguments.picture);
    return 0;
  }
  const ViewerOptions options = CheckedOptions(arguments);
  if (!options.out.empty()) PrepareDirectory(options.out);
  std::unique_ptr<LivePage> page;
  if (options.page.port > 0)
    page = std::make_unique<LivePage>(options.page, options.exports.placement, options.exports.coverage);
  const std::unique_ptr<Bus> bus = connect();
  Viewer viewer(options, std::move(page), bus.get());
  viewer.Run();
  return 0;
}

}  // namespace
}  // namespace mapmend

int main(int argc, char** argv) { return mapmend::RunMain("viewer_export", mapmend::Main, argc, argv); }

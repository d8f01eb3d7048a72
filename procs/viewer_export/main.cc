// viewer_export: follows a flight, shows it on a live page and writes the exports when the final map is there.

#include <CLI/CLI.hpp>
#include <cmath>

#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "libs/formats/map_formats.h"
#include "libs/geometry/read_trajectory.h"
#include "procs/viewer_export/edge_tool.h"
#include "procs/viewer_export/exporter.h"
#include "procs/viewer_export/live_server.h"
#include "procs/viewer_export/viewer.h"

namespace mapmend {
namespace {

int Main(int argc, char** argv) {
  CLI::App app(
      "Shows the map while it grows and writes it out when it is final: trajectories, point cloud, graph, report.",
      "viewer_export");
  ProcessOptions process;
  ViewerOptions options;
  std::vector<std::string> formats;
  double time_offset_s = 0, time_tolerance_s = 0;
  std::string ground_truth, times, report, bind = "127.0.0.1", truth_origin;
  std::string picture = "edge.png";
  std::vector<std::string> edge;
  int port = 0;
  AddProcessOptions(&app, &process);
  app.add_option("--out", options.out, "Directory for the exports (default: none are written)");
  app.add_option("--format", formats, "Formats to write beside those that always are, e.g. las,mcap");
  app.add_option("--frame", options.exports.frame, "Frame of reference of the exports")
      ->check(CLI::IsMember(FrameNames()))
      ->capture_default_str();
  app.add_option("--groundtruth", ground_truth, "trajectory to compare the map with");
  app.add_option("--times", times, "times of the frames, for a ground truth without times (KITTI)");
  app.add_option("--time-offset", time_offset_s, "seconds to add to the times of the ground truth");
  auto* tolerance =
      app.add_option("--time-tolerance", time_tolerance_s, "largest difference in time of poses compared, seconds")
          ->check(CLI::Range(0.0, 1e6));
  app.add_option("--groundtruth-origin", truth_origin,
                 "LATITUDE,LONGITUDE,ALTITUDE of a ground truth that is east, north, up (default: the first position)");
  app.add_option("--port", port, "TCP port of the live page, 0 for none")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  app.add_option("--bind", bind, "Address on which the live page listens")->capture_default_str();
  app.add_option("--report", report,
                 "Only make DIR/report.html again from DIR/summary.json and the pictures in DIR, then exit")
      ->type_name("DIR");
  auto* edge_option =
      app.add_option("--edge", edge, "Only draw the connection of two submaps, SESSION:NUMBER each, as --picture")
          ->expected(2);
  app.add_option("--picture", picture, "with --edge: the PNG file")->needs(edge_option);
  AddOptionFlags(&app, "viewer_export", &options);
  if (const auto code = ParseCommandLine(&app, argc, argv)) return *code;
  ApplyLogLevel(process);
  if (!report.empty()) {
    RebuildReport(report);
    return 0;
  }
  if (!edge.empty()) {
    InstallSignalHandlers();
    Bus bus(ResolveLcmUrl(process.lcm_url), process.channel_prefix);
    ShowEdge(&bus, ParseSubmapKey(edge[0]), ParseSubmapKey(edge[1]), picture);
    return 0;
  }
  if (tolerance->count() > 0) options.evaluation.tolerance_us = std::llround(time_tolerance_s * 1e6);
  options.exports.formats = ParseFormats(formats);
  RequireGoodOptions(OptionList::Of(options));
  if (!truth_origin.empty()) {
    options.exports.ground_truth_origin = ParseGeodetic(truth_origin, "--groundtruth-origin");
  } else if (!ground_truth.empty()) {
    options.exports.ground_truth_origin = FindOrigin(ground_truth);
  }
  // What can be wrong with the arguments shows before anything is connected.
  if (!ground_truth.empty()) {
    options.ground_truth = GroundTruth{ground_truth, ReadGroundTruth(ground_truth, times, time_offset_s).poses, {}};
    options.ground_truth->options = options.evaluation;
  }
  if (!options.out.empty()) PrepareDirectory(options.out);
  std::unique_ptr<LiveServer> server;
  if (port > 0) server = std::make_unique<LiveServer>(bind, port, options.out);
  InstallSignalHandlers();
  Bus bus(ResolveLcmUrl(process.lcm_url), process.channel_prefix);
  Viewer viewer(options, std::move(server), &bus);
  viewer.Run();
  return 0;
}

}  // namespace
}  // namespace mapmend

int main(int argc, char** argv) { return mapmend::RunMain("viewer_export", mapmend::Main, argc, argv); }

#include <CLI/CLI.hpp>
#include <memory>
#include <stdexcept>

#include "procs/mapmend/commands.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/run_flight.h"

namespace mapmend {

void AddDemoCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "demo", "Mend the bundled flight: two flights over one park, between which tracking is lost, become one map");
  const auto options = std::make_shared<RunOptions>();
  options->out = "mapmend-demo";
  sub->add_option("--out", options->out, "folder of the results; an earlier demo there is replaced")
      ->capture_default_str();
  sub->add_option("--port", options->port, "of the live page, 0: none (default: a free one from 8080 on)");
  sub->callback([options] {
    const std::string video = FindData("flights/sheffield_cross/video.mp4");
    if (video.empty()) throw std::runtime_error("the bundled flight is missing from mapmend's data");
    const std::string folder = video.substr(0, video.rfind('/') + 1);
    options->inputs = {video};
    options->camera = folder + "camera.yaml";
    options->times = folder + "times.txt";
    options->groundtruth = folder + "groundtruth.tum";
    options->gps = folder + "exif.csv";
    options->skip_frames = "74-83";  // around the break: without them tracking cannot but be lost
    options->title = "The bundled flight: two flights over one park";
    options->overwrite = true;
    const int code = RunFlight(CheckRunInputs(*options));
    if (code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend

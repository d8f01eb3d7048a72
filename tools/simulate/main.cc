// mapmend simulate: makes flights, walks and drives with exact ground truth.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "libs/command_line/command_line.h"
#include "tools/simulate/measure.h"
#include "tools/simulate/simulator.h"

namespace mapmend::simulate {
namespace {

volatile std::sig_atomic_t stop_requested = 0;
void RequestStop(int) { stop_requested = 1; }

// "A-B" or "A" into two numbers.
void ParseRange(const std::string& text, int count, int* first, int* last) {
  int consumed = 0;
  if (std::sscanf(text.c_str(), "%d-%d%n", first, last, &consumed) != 2 || consumed != static_cast<int>(text.size())) {
    throw std::runtime_error("--frames \"" + text + "\": expected FIRST-LAST, such as 0-99");
  }
  if (*first < 0 || *last < *first || *last >= count) {
    throw std::runtime_error("--frames " + text + ": the scenario has frames 0-" + std::to_string(count - 1));
  }
}

void ApplySize(const std::string& text, Camera* camera) {
  int width = 0, height = 0, consumed = 0;
  if (std::sscanf(text.c_str(), "%dx%d%n", &width, &height, &consumed) != 2 ||
      consumed != static_cast<int>(text.size()) || width < 16 || height < 16 || width % 2 != 0 || height % 2 != 0) {
    throw std::runtime_error("--size \"" + text + "\": expected WIDTHxHEIGHT, even numbers of at least 16");
  }
  const double sx = static_cast<double>(width) / camera->width, sy = static_cast<double>(height) / camera->height;
  camera->fx *= sx;
  camera->fy *= sy;
  camera->cx = (camera->cx + 0.5) * sx - 0.5;
  camera->cy = (camera->cy + 0.5) * sy - 0.5;
  camera->width = width;
  camera->height = height;
}

struct Arguments {
  std::string name, out, frames, size;
  std::optional<uint64_t> seed;
  std::optional<double> fps;
  double ortho = 0;  // metres per pixel; 0: none
  int threads = 0;
  bool list = false, images = false, quiet = false;
  MeasureOptions measured;
};

void AddFlightArguments(CLI::App* app, Arguments* arguments) {
  app->add_option("--scenario", arguments->name, "A scenario file, or the name of one of those in data/scenarios");
  app->add_option("--out", arguments->out, "Folder for the result; made if absent");
  app->add_option("--seed", arguments->seed, "Changes the wind, the noise and random events (default: the scenario's)");
  app->add_option("--frames", arguments->frames, "Only these frames, FIRST-LAST, counted from 0");
  app->add_option("--size", arguments->size, "Another image size, WIDTHxHEIGHT; the camera is scaled with it");
  app->add_option("--fps", arguments->fps, "Another frame rate; the run lasts as long as before");
  app->add_option("--threads", arguments->threads, "Threads (default: one per core); the result does not depend on it")
      ->check(CLI::Range(0, 256));
  app->add_option("--ortho", arguments->ortho,
                  "Also ortho.png and ortho.pgw, the land from straight above: metres per pixel")
      ->check(CLI::Range(0.001, 1000.0));
  app->add_flag("--images", arguments->images, "A folder of PNG files, images/, in place of the video");
  app->add_flag("--quiet", arguments->quiet, "No progress line");
  app->add_flag("--list", arguments->list, "List the scenarios and end");
}

CLI::App* AddMeasureCommand(CLI::App* app, MeasureOptions* options) {
  CLI::App* measure =
      app->add_subcommand("measure", "Print how an aerial sequence, real or simulated, looks to a SLAM system");
  measure->add_option("--video", options->video, "The video")->required();
  measure->add_option("--camera", options->camera, "Its calibration")->required();
  measure->add_option("--truth", options->truth, "world_from_camera per frame, TUM format")->required();
  measure->add_option("--vocabulary", options->vocabulary, "For BoW scores");
  measure->add_option("--ground", options->ground_height, "Height of the ground, metres");
  measure->add_option("--every", options->every, "Measure every Nth frame")->check(CLI::Range(1, 1000));
  measure->add_option("--features", options->num_features, "ORB features per frame")->check(CLI::Range(100, 20000));
  return measure;
}

void PrintScenarios(const std::string& folder) {
  for (const auto& [scenario, description] : ListScenarios(folder))
    std::printf("%-32s %s\n", scenario.c_str(), description.c_str());
}

// The scenario with what the command line changes.
Scenario MakeScenario(const Arguments& arguments, const std::string& folder) {
  if (arguments.name.empty()) throw UsageError("--scenario is missing (--list shows them)");
  if (arguments.out.empty()) throw UsageError("--out is missing");
  Scenario scenario = ReadScenario(arguments.name, folder);
  if (arguments.seed) scenario.seed = *arguments.seed;
  if (arguments.fps) {
    if (!(*arguments.fps > 0)) throw UsageError("--fps must be positive");
    scenario.frames = std::max(1, static_cast<int>(std::lround(scenario.frames / scenario.fps * *arguments.fps)));
    scenario.fps = *arguments.fps;
  }
  if (!arguments.size.empty()) ApplySize(arguments.size, &scenario.camera);
  if (arguments.images) scenario.output.images = true;
  scenario.Check();
  return scenario;
}

// Returns the exit code.
int Fly(const Arguments& arguments, const Scenario& scenario, const std::string& data) {
  int first = 0, last = scenario.frames - 1;
  if (!arguments.frames.empty()) ParseRange(arguments.frames, scenario.frames, &first, &last);
  const int threads =
      arguments.threads != 0 ? arguments.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  std::signal(SIGINT, RequestStop);
  std::signal(SIGTERM, RequestStop);

  const auto now = [] { return std::chrono::steady_clock::now(); };
  const auto seconds = [](auto from, auto to) { return std::chrono::duration<double>(to - from).count(); };
  const auto begin = now();
  Simulator simulator(scenario, data, threads);
  const auto built = now();
  const bool is_whole = WriteRun(&simulator, first, last, arguments.out, [&](int done, int all) {
    if (!arguments.quiet && (done == all || done % 10 == 0)) {
      const double rate = done / seconds(built, now());
      std::fprintf(stderr, "\r%s: frame %d of %d, %.1f frames/s, %.0f s left ", scenario.name.c_str(), done, all, rate,
                   (all - done) / rate);
    }
    return stop_requested == 0;
  });
  if (is_whole && arguments.ortho > 0) WriteOrtho(simulator, arguments.ortho, arguments.out);
  if (!arguments.quiet) std::fprintf(stderr, "\n");
  if (!is_whole) {
    std::cerr << "mapmend: simulate: interrupted; nothing was written\n";
    return 130;
  }
  if (!arguments.quiet) {
    std::printf("%s: %s (scene %.1f s, frames %.1f s)\n", scenario.name.c_str(), arguments.out.c_str(),
                seconds(begin, built), seconds(built, now()));
  }
  return 0;
}

}  // namespace
}  // namespace mapmend::simulate

int main(int argc, char** argv) {
  using namespace mapmend::simulate;
  CLI::App app(
      "Makes a synthetic flight, drive or walk with exact ground truth: video.mp4, times.txt, camera.yaml, "
      "groundtruth.tum, gps.csv, events.json and terrain.ply.",
      "mapmend simulate");
  app.set_version_flag("--version", std::string("mapmend simulate ") + MAPMEND_VERSION);
  Arguments arguments;
  AddFlightArguments(&app, &arguments);
  const CLI::App* measure = AddMeasureCommand(&app, &arguments.measured);
  if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
  try {
    if (measure->parsed()) {
      std::cout << Measure(arguments.measured) << "\n";
      return 0;
    }
    const std::string data = FindDataFolder(), scenarios = data + "/scenarios";
    if (arguments.list) {
      PrintScenarios(scenarios);
      return 0;
    }
    return Fly(arguments, MakeScenario(arguments, scenarios), data);
  } catch (const mapmend::UsageError& e) {
    std::cerr << "mapmend: simulate: " << e.what() << "\n";
    return mapmend::kExitUsage;
  } catch (const std::exception& e) {
    std::cerr << "mapmend: simulate: " << e.what() << "\n";
    return 1;
  }
}

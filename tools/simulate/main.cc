// mapmend simulate: makes flights, walks and drives with exact ground truth.

#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <thread>

#include "libs/command_line/command_line.h"
#include "tools/simulate/measure.h"
#include "tools/simulate/simulator.h"

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

void ApplySize(const std::string& text, mapmend::Camera* camera) {
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

}  // namespace

int main(int argc, char** argv) {
  using namespace mapmend::simulate;
  CLI::App app(
      "Makes a synthetic flight, drive or walk with exact ground truth: video.mp4, times.txt, camera.yaml, "
      "groundtruth.tum, "
      "gps.csv, events.json and terrain.ply.",
      "mapmend simulate");
  app.set_version_flag("--version", std::string("mapmend simulate ") + MAPMEND_VERSION);
  std::string name, out, frames, size;
  uint64_t seed = 0;
  double fps = 0, ortho = 0;
  int threads = 0;
  bool list = false, images = false, quiet = false;
  app.add_option("--scenario", name, "A scenario file, or the name of one of those in data/scenarios");
  app.add_option("--out", out, "Folder for the result; made if absent");
  const auto* seed_option =
      app.add_option("--seed", seed, "Changes the wind, the noise and random events (default: the scenario's)");
  app.add_option("--frames", frames, "Only these frames, FIRST-LAST, counted from 0");
  app.add_option("--size", size, "Another image size, WIDTHxHEIGHT; the camera is scaled with it");
  const auto* fps_option = app.add_option("--fps", fps, "Another frame rate; the run lasts as long as before");
  app.add_option("--threads", threads, "Threads (default: one per core); the result does not depend on it")
      ->check(CLI::Range(0, 256));
  app.add_option("--ortho", ortho, "Also ortho.png and ortho.pgw, the land from straight above: metres per pixel")
      ->check(CLI::Range(0.001, 1000.0));
  app.add_flag("--images", images, "A folder of PNG files, images/, in place of the video");
  app.add_flag("--quiet", quiet, "No progress line");
  app.add_flag("--list", list, "List the scenarios and end");
  MeasureOptions measured;
  CLI::App* measure =
      app.add_subcommand("measure", "Print how an aerial sequence, real or simulated, looks to a SLAM system");
  measure->add_option("--video", measured.video, "The video")->required();
  measure->add_option("--camera", measured.camera, "Its calibration")->required();
  measure->add_option("--truth", measured.truth, "world_from_camera per frame, TUM format")->required();
  measure->add_option("--vocabulary", measured.vocabulary, "For BoW scores");
  measure->add_option("--ground", measured.ground_height, "Height of the ground, metres");
  measure->add_option("--every", measured.every, "Measure every Nth frame")->check(CLI::Range(1, 1000));
  measure->add_option("--features", measured.num_features, "ORB features per frame")->check(CLI::Range(100, 20000));
  if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
  try {
    if (measure->parsed()) {
      std::cout << Measure(measured) << "\n";
      return 0;
    }
    const std::string data = FindDataFolder();
    if (list) {
      for (const auto& [scenario, description] : ListScenarios(data + "/scenarios")) {
        std::printf("%-32s %s\n", scenario.c_str(), description.c_str());
      }
      return 0;
    }
    if (name.empty()) throw mapmend::UsageError("--scenario is missing (--list shows them)");
    if (out.empty()) throw mapmend::UsageError("--out is missing");
    Scenario scenario = ReadScenario(name, data + "/scenarios");
    if (seed_option->count() > 0) scenario.seed = seed;
    if (fps_option->count() > 0) {
      if (!(fps > 0)) throw mapmend::UsageError("--fps must be positive");
      scenario.frames = std::max(1, static_cast<int>(std::lround(scenario.frames / scenario.fps * fps)));
      scenario.fps = fps;
    }
    if (!size.empty()) ApplySize(size, &scenario.camera);
    if (images) scenario.output.images = true;
    scenario.Check();
    int first = 0, last = scenario.frames - 1;
    if (!frames.empty()) ParseRange(frames, scenario.frames, &first, &last);
    if (threads == 0) threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    std::signal(SIGINT, RequestStop);
    std::signal(SIGTERM, RequestStop);

    const auto now = [] { return std::chrono::steady_clock::now(); };
    const auto seconds = [](auto from, auto to) { return std::chrono::duration<double>(to - from).count(); };
    const auto begin = now();
    Simulator simulator(scenario, data, threads);
    const auto built = now();
    const bool whole = WriteRun(&simulator, first, last, out, [&](int done, int all) {
      if (!quiet && (done == all || done % 10 == 0)) {
        const double rate = done / seconds(built, now());
        std::fprintf(stderr, "\r%s: frame %d of %d, %.1f frames/s, %.0f s left ", scenario.name.c_str(), done, all,
                     rate, (all - done) / rate);
      }
      return stop_requested == 0;
    });
    if (whole && ortho > 0) WriteOrtho(simulator, ortho, out);
    if (!quiet) std::fprintf(stderr, "\n");
    if (!whole) {
      std::cerr << "mapmend: simulate: interrupted; nothing was written\n";
      return 130;
    }
    if (!quiet) {
      std::printf("%s: %s (scene %.1f s, frames %.1f s)\n", scenario.name.c_str(), out.c_str(), seconds(begin, built),
                  seconds(built, now()));
    }
    return 0;
  } catch (const mapmend::UsageError& e) {
    std::cerr << "mapmend: simulate: " << e.what() << "\n";
    return mapmend::kExitUsage;
  } catch (const std::exception& e) {
    std::cerr << "mapmend: simulate: " << e.what() << "\n";
    return 1;
  }
}

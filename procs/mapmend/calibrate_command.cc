// `mapmend calibrate`: the camera by the map that it has made.

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/text_format.h"
#include "libs/base/text_table.h"
#include "libs/base/write_file.h"
#include "libs/bus/process.h"
#include "libs/geometry/camera_file.h"
#include "libs/merging/calibration_problem.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_consumer.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/map_file.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_summary.h"

namespace mapmend {
namespace {

struct CalibrateOptions {
  MapFileOptions file;
  std::string map, out;
  bool json = false;
};

// All flights of the map and its newest revision, from its store.
struct WholeMap {
  std::map<std::string, Session> sessions;
  MapRevision revision;
};

WholeMap ReadMap(Backend* backend, const std::string& db) {
  WholeMap map;
  StoreClient store(backend->bus(), "calibrate-" + std::to_string(getpid()));
  const auto reply = store.Fetch(FetchRequest{});
  if (!reply) throw std::runtime_error(db + ": the store does not answer");
  StoreClient::FetchedRevision stored = store.FetchRevision(-1);
  if (stored.status != StoreClient::RevisionStatus::kOk || !stored.revision.transforms.is_final)
    throw std::runtime_error(db + ": holds no final merged map; `mapmend merge` makes one");
  map.revision = std::move(stored.revision);
  StreamConsumer consumer(backend->bus(), &store, [&](const Record& record) {
    const std::string problem = map.sessions[record.header.session].Apply(record);
    if (!problem.empty()) throw std::runtime_error(db + ": " + problem);
  });
  const auto is_read = [&](const StreamCursor& last) {
    const auto it = map.sessions.find(last.session);
    return it != map.sessions.end() && it->second.last_seq >= last.seq;
  };
  while (!std::all_of(reply->sessions.begin(), reply->sessions.end(), is_read)) {
    consumer.Spin(20, 256);
    backend->Tick(0);
  }
  return map;
}

nlohmann::ordered_json ToJson(const Camera& before, const Calibration& c, const std::string& path) {
  return {
      {"focal_length_before_px", before.fx},
      {"focal_length_px", c.camera.fx},
      {"focal_length_sigma_px", c.sigma_focal},
      {"distortion_before", {before.distortion[0], before.distortion[1], before.distortion[2], before.distortion[3]}},
      {"distortion", {c.camera.distortion[0], c.camera.distortion[1], c.camera.distortion[2], c.camera.distortion[3]}},
      {"distortion_sigma", c.sigma_distortion},
      {"error_before_px", c.rms_before},
      {"error_px", c.rms_after},
      {"observations", c.num_observations},
      {"points", c.num_points},
      {"file", path}};
}

std::string ToText(const Camera& before, const Calibration& c, const std::string& path) {
  std::string text = Format("%-14s %12s %12s %12s\n", "", "before", "after", "sigma");
  text += Format("%-14s %12.2f %12.2f %12.2f\n", "focal length", before.fx, c.camera.fx, c.sigma_focal);
  const char* const names[] = {"k1", "k2", "p1", "p2"};
  for (int i = 0; i < 4; ++i) {
    text += Format("%-14s %12.5f %12.5f %12.5f\n", names[i], before.distortion[i], c.camera.distortion[i],
                   c.sigma_distortion[i]);
  }
  text += Format("%-14s %12.3f %12.3f\n", "error, px", c.rms_before, c.rms_after);
  text += Format("%d observations of %d points\n", c.num_observations, c.num_points);
  return text + "camera file " + path + ": map the flight again with --camera\n";
}

Calibration Work(const CalibrateOptions& options, CalibrationProblem* problem) {
  InstallSignalHandlers();
  Progress progress(options.json);
  try {
    MapFile map(options.file);
    progress.Show("reading the map");
    const WholeMap whole = ReadMap(map.backend(), options.file.place.db);
    *problem = MakeCalibrationProblem(whole.sessions, whole.revision);
    map.backend()->StopAll();
  } catch (const Interrupted&) {
    throw CLI::RuntimeError(kExitInterrupted);
  }
  progress.Show(
      Format("adjusting %zu keyframes, %zu points and the camera", problem->poses.size(), problem->points.size()));
  return CalibrateByMap(CalibrationOptions(), *problem);
}

void Calibrate(CalibrateOptions options) {
  options.file.place = FindMap(options.map);
  const std::string& folder = options.file.place.folder;
  if (options.out.empty()) {
    if (folder.empty()) throw std::runtime_error("give the camera file to write with --out");
    options.out = folder + "/calibrated_camera.yaml";
  }
  CalibrationProblem problem;
  const Calibration result = Work(options, &problem);
  if (!result.success) throw std::runtime_error(options.map + ": " + result.reason);
  std::vector<std::string> comments = {
      Format("calibrated by mapmend from %zu keyframes and %d points of %s", problem.poses.size(), result.num_points,
             std::filesystem::absolute(options.map).lexically_normal().filename().c_str()),
      Format("standard deviations: focal length %.2f px, k1 %.5f, k2 %.5f, p1 %.5f, p2 %.5f", result.sigma_focal,
             result.sigma_distortion[0], result.sigma_distortion[1], result.sigma_distortion[2],
             result.sigma_distortion[3])};
  WriteFile(options.out, FormatCameraFile(result.camera, comments));
  std::fputs((options.json ? ToJson(problem.camera, result, options.out).dump(2) + "\n"
                           : ToText(problem.camera, result, options.out))
                 .c_str(),
             stdout);
}

}  // namespace

void AddCalibrateCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "calibrate", "Refine focal length and lens distortion by a finished map, and write a camera file");
  const auto options = std::make_shared<CalibrateOptions>();
  sub->add_option("MAP", options->map, "folder of results, or a map database")->required();
  sub->add_option("--out", options->out, "camera file to write (default: calibrated_camera.yaml in MAP)");
  sub->add_flag("--json", options->json, "print the result as JSON");
  options->file.settings.AddFlags(sub, {"hub", "submap_store"});
  sub->footer(
      "Not every flight tells the focal length: straight down, or straight ahead without turning, it cannot be told\n"
      "from the distance. Then nothing is written, and the exit code is 1.");
  sub->callback([options] {
    options->file.settings.Resolve();
    Calibrate(*options);
  });
}

}  // namespace mapmend

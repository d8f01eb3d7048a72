#include "procs/viewer_export/exporter.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "libs/base/write_file.h"
#include "libs/formats/map_formats.h"
#include "libs/map_view/level_frame.h"
#include "procs/viewer_export/colmap_export.h"
#include "procs/viewer_export/edge_export.h"
#include "procs/viewer_export/gap_export.h"
#include "procs/viewer_export/geo_export.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/mosaic_export.h"
#include "procs/viewer_export/placed_map_export.h"
#include "procs/viewer_export/ply_export.h"
#include "procs/viewer_export/report.h"
#include "procs/viewer_export/summary.h"
#include "procs/viewer_export/trajectory_picture.h"
#include "procs/viewer_export/world_error.h"
#include "procs/viewer_export/world_summary.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

void MakeDirectory(const fs::path& dir) {
  std::error_code error;
  fs::create_directories(dir, error);
  if (error) throw std::runtime_error("cannot create the directory " + dir.string() + ": " + error.message());
  if (!fs::is_directory(dir)) throw std::runtime_error(dir.string() + " is not a directory");
}

bool IsNumber(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Removes what an earlier export wrote into dir/<number>/, for numbers not in keep; files of other names are left
// alone.
void RemoveStale(const fs::path& dir, const std::vector<int>& keep) {
  std::error_code error;
  std::vector<fs::path> stale;
  for (const fs::directory_entry& entry : fs::directory_iterator(dir, error)) {
    const std::string name = entry.path().filename().string();
    if (!IsNumber(name)) continue;
    if (std::none_of(keep.begin(), keep.end(), [&](int n) { return std::to_string(n) == name; }))
      stale.push_back(entry.path());
  }
  for (const fs::path& path : stale) {
    fs::remove(path / "trajectory.svg", error);
    for (const std::string& file : MosaicFiles()) fs::remove(path / file, error);
    for (const MapFormat& format : MapFormats()) {
      for (const std::string& file : format.files) fs::remove(path / file, error);
    }
    fs::remove(path, error);  // only if empty now
  }
}

std::string Describe(const Snapshot& snapshot, int component) {
  const FrameOfReference& frame = snapshot.components[component].frame;
  const SnapshotSubmap& root = snapshot.submaps[snapshot.components[component].root];
  return "t tx ty tz qx qy qz qw, world_from_camera; world: " +
         (frame.name == "map" ? "the frame and unit of submap " + std::to_string(root.number) : Describe(frame));
}

// With the coordinates of the reference system in full: the text has the digits.
Trajectory InFull(Trajectory trajectory, const FrameOfReference& frame) {
  for (StampedPose& pose : trajectory) pose.world_from_camera.translation += frame.origin;
  return trajectory;
}

// What cannot have the frame stays as it is.
void ChooseFrames(const std::string& name, const WorldPlacement* world, Snapshot* snapshot) {
  if (world != nullptr && (name == "enu" || name == "utm")) PlaceOnEarth(*world, name, snapshot);
  for (int c = 0; c < static_cast<int>(snapshot->components.size()); ++c) {
    if (name == "level") PlaceLevel(c, snapshot);
  }
}

struct EvaluatedMap {
  const GroundTruth* ground_truth = nullptr;
  MapEvaluation evaluation;
};

std::string TrajectorySvg(const Snapshot& snapshot, int component, const EvaluatedMap& evaluated) {
  TrajectoryPictureOptions options;
  if (evaluated.ground_truth != nullptr) {
    options.evaluation = &evaluated.evaluation.components[component];
    options.ground_truth = &evaluated.ground_truth->trajectory;
  }
  return MakeTrajectorySvg(snapshot, component, options);
}

void ExportComponent(const Snapshot& snapshot, int component, const EvaluatedMap& evaluated, const fs::path& dir) {
  MakeDirectory(dir);
  const SnapshotComponent& c = snapshot.components[component];
  WriteTrajectory((dir / "frames.tum").string(), InFull(ToTrajectory(c.frames), c.frame),
                  Describe(snapshot, component));
  WriteTrajectory((dir / "keyframes.tum").string(), InFull(ToTrajectory(c.keyframes), c.frame),
                  Describe(snapshot, component));
  WriteFile((dir / "map.ply").string(), MakePly(snapshot, component));
  WriteFile((dir / "cameras.ply").string(), MakeCamerasPly(snapshot, component));
  WriteFile((dir / "trajectory.svg").string(), TrajectorySvg(snapshot, component, evaluated));
}

// One at a time, for attempt to run: a format that fails keeps no other from being written.
void ExportFormats(const Snapshot& snapshot, int component, const std::vector<std::string>& formats,
                   const fs::path& dir, const std::function<void(const std::function<void()>&)>& attempt) {
  if (formats.empty()) return;
  const PlacedMap map = MakePlacedMap(snapshot, component);
  for (const std::string& format : formats) attempt([&] { WriteFormat(format, map, dir.string()); });
}

// Those asked for, and those that lie there from an earlier export.
std::vector<std::string> FormatsToWrite(const std::vector<std::string>& asked, const std::string& dir) {
  std::vector<std::string> formats = FormatsIn(dir);
  for (const std::string& format : asked) {
    if (std::find(formats.begin(), formats.end(), format) == formats.end() && !IsAlwaysWritten(format))
      formats.push_back(format);
  }
  return formats;
}

// A file that there is only sometimes: empty removes what an earlier export left.
void WriteOrRemove(const fs::path& path, const std::string& content) {
  std::error_code error;
  content.empty() ? static_cast<void>(fs::remove(path, error)) : WriteFile(path.string(), content);
}

// What only a map with a place on the earth has.
//   world  null without
void ExportWorld(const Snapshot& placed, const GapReport& gaps, const WorldPlacement* world, const fs::path& dir) {
  const auto write = [&](const char* file, const auto& make) {
    WriteOrRemove(dir / file, world == nullptr ? std::string() : make());
  };
  write("positions.csv", [&] { return MakePositionsCsv(placed, *world); });
  write("path.geojson", [&] { return MakePathGeoJson(placed, *world); });
  write("map.kml", [&] { return MakeMapKml(placed, *world, MakeGapsKmlFolder(gaps, *world)); });
  write("gaps.geojson", [&] { return MakeGapsGeoJson(gaps, *world); });
  write("gaps.kml", [&] { return MakeGapsKml(gaps, *world); });
  write("gaps.plan", [&] { return MakeQgcPlan(gaps, *world); });
  write("gaps.waypoints", [&] { return MakeWaypoints(gaps, *world); });
}

// The picture of the ground of each component, on the earth if its place is known. Returns what summary.json says of
// the main one.
std::string ExportMosaics(const MapModel& model, const WorldPlacement* world, const ExportOptions& options,
                          const fs::path& dir) {
  if (!options.mosaic.enabled || !options.pictures.image) return "";
  Snapshot snapshot = MakeSnapshot(model);
  if (world != nullptr) PlaceOnEarth(*world, "utm", &snapshot);
  std::string of_main;
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    const fs::path folder = c == 0 ? dir : dir / "components" / std::to_string(c);
    const std::string json =
        ExportMosaic(snapshot, c, options.pictures.image, options.mosaic, options.progress, folder.string());
    if (c == 0) of_main = json;
  }
  return of_main;
}

// The files that others rely on, for a flight in which tracking never started.
void ExportNothing(const fs::path& dir) {
  for (const char* file : {"frames.tum", "keyframes.tum"})
    WriteTrajectory((dir / file).string(), {}, "no frame was tracked");
  std::error_code error;
  fs::remove(dir / "trajectory.svg", error);
  for (const std::string& file : MosaicFiles()) fs::remove(dir / file, error);
  for (const MapFormat& format : MapFormats()) {
    if (format.name == "tum") continue;
    for (const std::string& file : format.files) fs::remove_all(dir / file, error);
  }
}

void ExportSubmaps(const Snapshot& snapshot, const fs::path& dir) {
  MakeDirectory(dir);
  std::vector<int> numbers;
  for (const SnapshotSubmap& submap : snapshot.submaps) {
    const fs::path folder = dir / std::to_string(submap.number);
    MakeDirectory(folder);
    WriteTrajectory((folder / "frames.tum").string(), TrackedTrajectory(*submap.submap),
                    "t tx ty tz qx qy qz qw, world_from_camera as tracked; world: the submap's own frame and unit");
    numbers.push_back(submap.number);
  }
  RemoveStale(dir, numbers);
}

}  // namespace

void PrepareDirectory(const std::string& dir) {
  MakeDirectory(dir);
  const std::string probe = (fs::path(dir) / ".write_test").string();
  WriteFile(probe, "");
  std::error_code error;
  fs::remove(probe, error);
}

std::vector<std::string> ExportAll(const MapModel& model, const GroundTruth* ground_truth, const std::string& dir_name,
                                   const ExportOptions& options) {
  const fs::path dir = dir_name;
  const std::vector<std::string> formats = FormatsToWrite(options.formats, dir_name);
  std::vector<std::string> problems;
  const auto attempt = [&](const std::function<void()>& write) {
    try {
      write();
    } catch (const std::runtime_error& e) {
      problems.emplace_back(e.what());
    }
  };
  attempt([&] { PrepareDirectory(dir_name); });
  Snapshot snapshot = MakeSnapshot(model);
  const std::optional<WorldPlacement> world = PlaceOnEarth(snapshot, options.placement);
  const WorldPlacement* found = world && world->problem.empty() ? &*world : nullptr;
  Snapshot placed = snapshot;
  if (found != nullptr) PlaceOnEarth(*found, "enu", &placed);
  ChooseFrames(options.frame, found, &snapshot);
  EvaluatedMap evaluated;
  evaluated.ground_truth = ground_truth;
  if (ground_truth != nullptr) evaluated.evaluation = EvaluateMap(snapshot, *ground_truth);
  attempt([&] {
    if (snapshot.components.empty()) {
      ExportNothing(dir);
    } else {
      ExportColmap(snapshot, 0, options.pictures.image, (dir / "colmap").string());
    }
  });
  std::vector<int> others;
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    const fs::path folder = c == 0 ? dir : dir / "components" / std::to_string(c);
    attempt([&] { ExportComponent(snapshot, c, evaluated, folder); });
    ExportFormats(snapshot, c, formats, folder, attempt);
    if (c > 0) others.push_back(c);
  }
  RemoveStale(dir / "components", others);
  attempt([&] { ExportSubmaps(snapshot, dir / "submaps"); });
  attempt([&] { ExportEdgePictures(snapshot, options.pictures, (dir / "edges").string()); });
  std::string mosaic;
  attempt([&] { mosaic = ExportMosaics(model, found, options, dir); });
  const GapReport gaps = FindGaps(placed, found, options.coverage);
  attempt([&] { ExportWorld(placed, gaps, found, dir); });
  attempt([&] { WriteOrRemove(dir / "gaps.svg", MakeGapsSvg(placed, gaps)); });
  attempt([&] { WriteFile((dir / "graph.dot").string(), MakeGraphDot(snapshot)); });
  attempt([&] { WriteFile((dir / "graph.svg").string(), MakeGraphSvg(snapshot)); });
  attempt([&] {
    SummaryParts parts;
    if (world) parts.world = MakeWorldJson(placed, *world, {ground_truth, options.ground_truth_origin});
    parts.gaps = MakeGapsJson(gaps);
    parts.mosaic = mosaic;
    WriteFile(
        (dir / "summary.json").string(),
        MakeSummaryJson(snapshot, ground_truth != nullptr ? &evaluated.evaluation : nullptr, ground_truth, parts));
  });
  attempt([&] { RebuildReport(dir_name); });
  return problems;
}

void RebuildReport(const std::string& dir_name) {
  const fs::path dir = dir_name;
  const std::string summary = ReadFile((dir / "summary.json").string());
  std::error_code error;
  const auto read = [&](const fs::path& path) {
    return fs::exists(path, error) ? ReadFile(path.string()) : std::string();
  };
  ReportPictures pictures;
  pictures.graph_svg = ReadFile((dir / "graph.svg").string());
  for (fs::path folder = dir; fs::exists(folder / "trajectory.svg", error);
       folder = dir / "components" / std::to_string(pictures.trajectory_svgs.size())) {
    pictures.trajectory_svgs.push_back(ReadFile((folder / "trajectory.svg").string()));
  }
  pictures.edge_pictures = ReadEdgePictures((dir / "edges").string());
  pictures.gaps_svg = read(dir / "gaps.svg");
  if (const std::string mosaic = read(dir / "mosaic.png"); !mosaic.empty()) pictures.mosaic_jpeg = AsJpeg(mosaic);
  pictures.coverage_png = read(dir / "coverage.png");
  WriteFile((dir / "report.html").string(), MakeReport(summary, pictures));
}

}  // namespace mapmend

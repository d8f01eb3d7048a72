// `mapmend eval EST.tum ... GT.tum`: absolute trajectory error after alignment, coverage, a picture.

#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>
#include <memory>

#include "libs/base/write_file.h"
#include "libs/geometry/read_trajectory.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/evaluation_report.h"
#include "procs/mapmend/raster_canvas.h"

namespace mapmend {
namespace {

struct EvalOptions {
  std::vector<std::string> files;  // estimates, then the ground truth
  bool rigid = false;
  double tolerance_s = 0.01, time_offset_s = 0;
  std::string times;
  std::string picture, json;
};

std::string DrawPicture(const TopView& view, const std::string& path) {
  if (path.ends_with(".svg")) return TopViewSvg(view);
  const Eigen::Vector2d size = TopViewSize(view);
  RasterCanvas canvas(size.x(), size.y());
  DrawTopView(view, &canvas);
  return canvas.EncodePng();
}

void Run(const EvalOptions& arguments) {
  if (!arguments.picture.empty() && !arguments.picture.ends_with(".svg") && !arguments.picture.ends_with(".png")) {
    throw std::runtime_error("--picture " + arguments.picture + ": the name must end in .svg or .png");
  }
  const TrajectoryFile truth = ReadGroundTruth(arguments.files.back(), arguments.times, arguments.time_offset_s);
  const Trajectory& ground_truth = truth.poses;
  EvaluationOptions options;
  options.kind = arguments.rigid ? AlignmentKind::kRigid : AlignmentKind::kSimilarity;
  options.tolerance_us = std::llround(arguments.tolerance_s * 1e6);
  std::vector<EvaluatedTrajectory> evaluated;
  bool any = false;
  for (size_t i = 0; i + 1 < arguments.files.size(); ++i) {
    const TrajectoryFile estimate = ReadTrajectoryFile(arguments.files[i]);
    if (!estimate.note.empty()) std::cerr << estimate.note << "\n";
    EvaluatedTrajectory e{arguments.files[i], estimate.poses, {}};
    e.evaluation = EvaluateTrajectory(e.trajectory, ground_truth, options);
    any |= e.evaluation.success;
    evaluated.push_back(std::move(e));
  }
  if (!truth.note.empty()) std::cerr << "ground truth " << truth.note << "\n";
  std::cout << FormatEvaluationTable(evaluated) << std::flush;
  if (!arguments.json.empty()) {
    WriteFile(arguments.json, FormatEvaluationJson(evaluated, arguments.files.back(), options));
  }
  if (!arguments.picture.empty()) {
    WriteFile(arguments.picture, DrawPicture(MakeEvaluationView(evaluated, ground_truth), arguments.picture));
  }
  if (!any) throw std::runtime_error("eval: no trajectory could be aligned to " + arguments.files.back());
}

}  // namespace

void AddEvalCommand(CLI::App* app) {
  auto options = std::make_shared<EvalOptions>();
  CLI::App* sub =
      app->add_subcommand("eval", "Compare trajectories with ground truth: absolute trajectory error and coverage");
  sub->add_option("files", options->files,
                  "One or more estimates, then the ground truth: TUM files (t tx ty tz qx qy qz qw, "
                  "world_from_camera), EuRoC's csv, positions (t x y z), or KITTI's matrices with "
                  "--times. Each "
                  "estimate is aligned by itself; `mapmend eval out/submaps/*/frames.tum GT.tum` checks every submap.")
      ->required()
      ->expected(2, 100000)
      ->type_name("EST.tum ... GT.tum");
  sub->add_flag("--se3", options->rigid, "Align with rotation and translation only (default: with scale too, Sim(3))");
  sub->add_option("--tolerance", options->tolerance_s, "Largest difference in time of poses compared, seconds")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  sub->add_option("--time-offset", options->time_offset_s, "Seconds to add to the times of the ground truth");
  sub->add_option("--times", options->times, "Times of the frames, for a ground truth without times (KITTI)");
  sub->add_option("--picture", options->picture, "Write a top view of the aligned trajectories: FILE.svg or FILE.png");
  sub->add_option("--json", options->json, "Write the figures as JSON");
  sub->callback([options] { Run(*options); });
}

}  // namespace mapmend

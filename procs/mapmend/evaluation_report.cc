#include "procs/mapmend/evaluation_report.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace {

template <typename... Args>
std::string Print(const char* format, Args... args) {
  char text[512];
  std::snprintf(text, sizeof(text), format, args...);
  return text;
}

}  // namespace

std::string FormatEvaluationTable(const std::vector<EvaluatedTrajectory>& evaluated) {
  size_t width = 10;
  for (const EvaluatedTrajectory& e : evaluated) width = std::max(width, e.file.size());
  const int w = static_cast<int>(width);
  std::string table = Print("%-*s %6s %6s %9s %10s %10s %10s %16s %10s\n", w, "trajectory", "poses", "pairs",
                            "coverage", "RMSE m", "median m", "max m", "max at s", "scale");
  const EvaluatedTrajectory* worst = nullptr;
  for (const EvaluatedTrajectory& e : evaluated) {
    const Evaluation& v = e.evaluation;
    table += Print("%-*s %6zu %6zu %7.1f %%", w, e.file.c_str(), v.num_estimate, v.pairs.size(), 100 * v.coverage);
    if (!v.success) {
      table += "  not aligned: " + v.reason + "\n";
      continue;
    }
    table += Print(" %10.4f %10.4f %10.4f %16s %10.5g%s\n", v.rmse, v.median, v.max, FormatSeconds(v.max_utime).c_str(),
                   v.reference_from_estimate.scale, v.collinear ? "  (on one line)" : "");
    if (worst == nullptr || v.max > worst->evaluation.max) worst = &e;
  }
  if (evaluated.size() > 1 && worst != nullptr) {
    table += Print("largest error %.4f m in ", worst->evaluation.max) + worst->file + "\n";
  }
  return table;
}

std::string FormatEvaluationJson(const std::vector<EvaluatedTrajectory>& evaluated,
                                 const std::string& ground_truth_file, const EvaluationOptions& options) {
  nlohmann::ordered_json json;
  json["groundtruth"] = ground_truth_file;
  json["alignment"] = options.kind == AlignmentKind::kSimilarity ? "sim3" : "se3";
  json["tolerance_s"] = static_cast<double>(options.tolerance_us) * 1e-6;
  json["trajectories"] = nlohmann::ordered_json::array();
  for (const EvaluatedTrajectory& e : evaluated) {
    const Evaluation& v = e.evaluation;
    nlohmann::ordered_json entry = {{"file", e.file},          {"success", v.success},    {"reason", v.reason},
                                    {"poses", v.num_estimate}, {"pairs", v.pairs.size()}, {"coverage", v.coverage}};
    if (v.success) {
      const std::array<double, 8> t = ToArray(v.reference_from_estimate);
      entry["rmse_m"] = v.rmse;
      entry["mean_m"] = v.mean;
      entry["median_m"] = v.median;
      entry["max_m"] = v.max;
      entry["max_at_s"] = static_cast<double>(v.max_utime) * 1e-6;
      entry["reference_from_estimate"] = {
          {"scale", t[7]}, {"translation", {t[0], t[1], t[2]}}, {"quaternion_xyzw", {t[3], t[4], t[5], t[6]}}};
    }
    json["trajectories"].push_back(entry);
  }
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

TopView MakeEvaluationView(const std::vector<EvaluatedTrajectory>& evaluated, const Trajectory& ground_truth) {
  const PlaneView plane = GroundPlane(ground_truth);
  TopView view;
  view.title = evaluated.size() == 1 ? "Trajectory against ground truth" : "Trajectories against ground truth";
  TopViewTrack truth;
  truth.label = "ground truth";
  truth.color = "#8c97a3";
  truth.width = 4;
  truth.pieces = ProjectPieces(ground_truth, plane);
  view.tracks.push_back(truth);
  TopViewTrack errors;
  errors.label = "error";
  errors.color = "#d6212b";
  errors.width = 1;
  std::string worst;
  for (size_t i = 0; i < evaluated.size(); ++i) {
    const Evaluation& v = evaluated[i].evaluation;
    if (!v.success) continue;
    const Trajectory aligned = TransformTrajectory(evaluated[i].trajectory, v.reference_from_estimate);
    TopViewTrack track;
    const size_t slash = evaluated[i].file.find_last_of('/');
    track.label =
        evaluated.size() == 1 ? "estimate" : evaluated[i].file.substr(slash == std::string::npos ? 0 : slash + 1);
    track.tooltip = evaluated[i].file + Print(": RMSE %.3f m, max %.3f m", v.rmse, v.max);
    track.color = CategoryColor(static_cast<int>(i));
    track.width = 1.8;
    track.pieces = ProjectPieces(aligned, plane);
    view.tracks.push_back(track);
    for (const TimePair& pair : v.pairs) {
      errors.pieces.push_back({plane.Project(aligned[pair.estimate].world_from_camera.translation),
                               plane.Project(ground_truth[pair.reference].world_from_camera.translation)});
    }
    if (evaluated.size() == 1) {
      view.subtitle = Print("RMSE %.3f m, median %.3f m, max %.3f m; %zu of %zu ground-truth poses covered", v.rmse,
                            v.median, v.max, v.pairs.size(), v.num_reference);
    }
  }
  view.tracks.push_back(errors);
  return view;
}

}  // namespace mapmend

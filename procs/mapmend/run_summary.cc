#include "procs/mapmend/run_summary.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "libs/base/plural.h"
#include "libs/base/text_format.h"
#include "libs/base/write_file.h"
#include "procs/mapmend/flight_verdict.h"
#include "procs/mapmend/progress.h"

namespace mapmend {
namespace {

using OrderedJson = nlohmann::ordered_json;

int Count(const OrderedJson& summary, const char* key) {
  const auto found = summary.find(key);
  return found != summary.end() && found->is_number() ? found->get<int>() : 0;
}

size_t Size(const OrderedJson& summary, const char* key) {
  const auto found = summary.find(key);
  return found != summary.end() && found->is_array() ? found->size() : 0;
}

double Number(const OrderedJson& object, const char* key, double fallback = 0) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : fallback;
}

// Where the main map lies, and how well it fits.
std::string DescribeWorld(const OrderedJson& world) {
  if (world.contains("problem")) return "not placed: " + world.value("problem", std::string());
  const OrderedJson main =
      world.value("components", OrderedJson::array()).empty() ? OrderedJson::object() : world["components"][0];
  if (!main.value("placed", false)) return "main map not placed: " + main.value("problem", std::string());
  std::string text = Format("placed by %d positions, %.2f m beside them horizontally (median)",
                            Count(main, "positions"), Number(main, "horizontal_residual_median_m"));
  if (main.contains("groundtruth"))
    text += Format("; %.2f m from the ground truth without alignment (RMSE, horizontally)",
                   Number(main["groundtruth"], "horizontal_rmse_m"));
  if (main.contains("problem")) text += "; " + main.value("problem", std::string());
  return text;
}

std::string DescribeMosaic(const OrderedJson& mosaic) {
  if (const std::string problem = mosaic.value("problem", ""); !problem.empty()) return "no picture: " + problem;
  const std::string size = Format("mosaic.tif, %d x %d pixels", Count(mosaic, "width"), Count(mosaic, "height"));
  return mosaic.value("unit", "") == "m" ? size + Format(" of %.2g m", Number(mosaic, "gsd")) : size;
}

// "; weak: 2–3" of connections that hold the map together, though loosely; empty: there are none.
std::string DescribeWeak(const OrderedJson& summary) {
  std::string weak;
  for (const OrderedJson& c : summary.value("connections", OrderedJson::array())) {
    if (!c.value("in_tree", false) || !c.value("weak", false)) continue;
    weak += (weak.empty() ? "" : ", ") + Format("%d–%d", Count(c, "a"), Count(c, "b"));
  }
  return weak.empty() ? "" : "; weak: " + weak + " (the report says how weak)";
}

// "2: after frame 73 (too few matches), after frame 140 (darkness)".
std::string DescribeLosses(const OrderedJson& summary) {
  constexpr int kNamed = 3;
  std::string text = std::to_string(Count(summary, "losses"));
  int count = 0;
  for (const OrderedJson& submap : summary.value("submaps", OrderedJson::array())) {
    std::string reason = submap.value("end_reason", "");
    const int last_frame = submap.value("last_frame", -1);
    if (reason.empty() || reason == "end_of_input" || last_frame < 0) continue;
    if (++count > kNamed) return text + ", ...";
    std::replace(reason.begin(), reason.end(), '_', ' ');
    text += (count == 1 ? ": after frame " : ", after frame ") + std::to_string(last_frame) + " (" + reason + ")";
  }
  return text;
}

// The table that a run ends with, row by row.
class SummaryTable {
 public:
  explicit SummaryTable(const OrderedJson& summary)
      : summary_(summary),
        frontend_(summary.value("frontend", OrderedJson::object())),
        frames_(Count(summary, "frames_in")) {}

  std::string Text() {
    AddFrames();
    AddMap();
    AddPlaces();
    AddTime();
    AddProfile();
    return std::move(table_);
  }

 private:
  void Add(const char* name, const std::string& text) { table_ += Format("  %-13s", name) + text + "\n"; }

  int NumAccepted(const char* list) const {
    int accepted = 0;
    for (const OrderedJson& connection : summary_.value(list, OrderedJson::array())) {
      if (connection.value("verdict", "") == "accepted") ++accepted;
    }
    return accepted;
  }

  void AddFrames() {
    const int in_main = Count(summary_, "frames_in_main"), dropped = Count(frontend_, "frames_dropped");
    const int flight = frames_ + dropped;
    Add("frames", Format("%d read, %d tracked, %d in the main map (%.1f %% of the flight)", frames_,
                         Count(summary_, "frames_tracked"), in_main, flight > 0 ? 100.0 * in_main / flight : 0.0));
    if (dropped > 0) Add("dropped", Plural(dropped, "frame") + " that came while the frontend was busy");
    if (const int left_out = Count(frontend_, "frames_left_out"); left_out > 0)
      Add("left out", Plural(left_out, "frame") + " that could not be used; see logs/frontend.log");
    if (const int bad = Count(frontend_, "bad_messages"); bad > 0)
      Add("refused", Plural(bad, "image") + "; see logs/frontend.log");
    if (const std::string holes = summary_.value("holes_in_words", ""); !holes.empty() && in_main > 0)
      Add("holes", holes);
    Add("losses", DescribeLosses(summary_));
  }

  void AddMap() {
    const size_t parts = Size(summary_, "components");
    Add("submaps",
        Format("%zu in ", Size(summary_, "submaps")) + (parts == 1 ? "one piece" : Format("%zu parts", parts)));
    Add("connections",
        Format("%d accepted of %zu evaluated", NumAccepted("connections"), Size(summary_, "connections")) +
            DescribeWeak(summary_));
    if (const int loops = NumAccepted("loops"); loops > 0) Add("loops", "closed within " + Plural(loops, "submap"));
    Add("keyframes", Format("%d of %d in the main map, %d points", Count(summary_, "keyframes_in_main"),
                            Count(summary_, "keyframes_total"), Count(summary_, "points_in_main")));
    if (const OrderedJson images = summary_.value("images", OrderedJson::object()); Count(images, "stored") > 0) {
      const int missing = Count(images, "missing");
      Add("images", "of " + Plural(Count(images, "stored"), "keyframe") +
                        (missing > 0 ? Format(", %d are missing", missing) : ""));
    }
  }

  // Where the map lies, and how exact it is.
  void AddPlaces() {
    if (summary_.contains("mosaic")) Add("ground", DescribeMosaic(summary_["mosaic"]));
    if (summary_.contains("ate_rmse_m")) {
      Add("accuracy",
          Format("%.3f m ATE RMSE against the ground truth (median %.3f, max %.3f)", Number(summary_, "ate_rmse_m"),
                 Number(summary_, "ate_median_m"), Number(summary_, "ate_max_m")));
    }
    if (summary_.contains("groundtruth_problem"))
      Add("accuracy", "unknown: " + summary_.value("groundtruth_problem", std::string()));
    if (summary_.contains("world")) Add("on earth", DescribeWorld(summary_["world"]));
    if (summary_.contains("max_error_of_depth")) {
      Add("", Format("largest error within a submap: %.2f %% of the distance to the scene",
                     100 * Number(summary_, "max_error_of_depth")));
    }
    if (summary_.contains("readout_ms")) {
      const bool by_columns = summary_.value("readout_by", "rows") == "columns";
      Add("shutter", Format("rolling, %.1f ms from the first to the last %s; corrected", Number(summary_, "readout_ms"),
                            by_columns ? "column" : "row"));
    }
  }

  void AddTime() {
    const double wall = Number(summary_, "wall_s");
    std::string time = FormatDuration(wall) + Format(" (%.1f frames/s)", wall > 0 ? frames_ / wall : 0.0);
    if (frontend_.contains("track_ms_median")) {
      time += Format(", tracking %.1f ms a frame (p95 %.1f)", Number(frontend_, "track_ms_median"),
                     Number(frontend_, "track_ms_p95"));
    }
    Add("time", time);
    for (const OrderedJson& process : summary_.value("processes", OrderedJson::array())) {
      Add(process.value("name", "").c_str(),
          Format("%7.1f CPU s %7.0f MB", Number(process, "cpu_s"), Number(process, "peak_rss_mb")));
    }
  }

  void AddProfile() {
    if (!frontend_.contains("profile")) return;
    table_ += Format("  %-20s %8s %11s %9s %9s\n", "stage", "frames", "median ms", "p95 ms", "total s");
    for (const OrderedJson& stage : frontend_["profile"]) {
      table_ += Format("  %-20s %8d %11.2f %9.2f %9.2f\n", stage.value("stage", "").c_str(), Count(stage, "frames"),
                       Number(stage, "median_ms"), Number(stage, "p95_ms"), Number(stage, "total_s"));
    }
  }

  const OrderedJson& summary_;
  const OrderedJson frontend_;
  const int frames_;
  std::string table_;
};

}  // namespace

std::optional<ShutterFigures> FindShutter(const HealthMonitor::Entry* merger) {
  const std::optional<double> readout_ms = FindCounter(merger, "readout_ms");
  if (!readout_ms) return std::nullopt;
  return ShutterFigures{*readout_ms, CounterOr(merger, "readout_by_columns", 0) > 0};
}

OrderedJson ReadSummary(const std::string& out) {
  const std::string path = out + "/summary.json";
  try {
    OrderedJson summary = OrderedJson::parse(ReadFile(path));
    if (summary.is_object()) return summary;
  } catch (const OrderedJson::exception&) {
  }
  throw std::runtime_error(path + " is not a JSON object");
}

void CompleteSummary(const std::string& out, const LauncherFigures& figures) {
  OrderedJson summary = ReadSummary(out);
  std::filesystem::path folder = std::filesystem::absolute(out).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();  // "results/"
  summary["title"] = figures.title.empty() ? folder.filename().string() : figures.title;
  summary["wall_s"] = figures.wall_s;
  OrderedJson frontend = OrderedJson::object();
  if (!figures.mode.empty()) {
    frontend["mode"] = figures.mode;
    frontend["frames_dropped"] = figures.frames_dropped;
    frontend["frames_left_out"] = figures.frames_left_out;
    frontend["bad_messages"] = figures.bad_messages;
    if (!figures.untracked.empty()) frontend["untracked"] = figures.untracked;
  }
  if (figures.track_ms_median) frontend["track_ms_median"] = *figures.track_ms_median;
  if (figures.track_ms_p95) frontend["track_ms_p95"] = *figures.track_ms_p95;
  if (!figures.profile_json.empty()) {
    const OrderedJson profile = OrderedJson::parse(figures.profile_json, nullptr, false);
    if (!profile.is_array()) throw std::runtime_error("the frontend's profile is not a JSON array");
    frontend["profile"] = profile;
  }
  summary["frontend"] = frontend;
  OrderedJson processes = OrderedJson::array();
  for (const auto& [name, usage] : figures.processes) {
    processes.push_back({{"name", name}, {"cpu_s", usage.cpu_s}, {"peak_rss_mb", usage.peak_rss_mb}});
  }
  summary["processes"] = processes;
  if (figures.images) summary["images"] = {{"stored", figures.images->stored}, {"missing", figures.images->missing}};
  if (figures.shutter) {
    summary["readout_ms"] = figures.shutter->readout_ms;
    summary["readout_by"] = figures.shutter->by_columns ? "columns" : "rows";
  }
  if (const std::string problem = DescribeSmallMap(summary, figures.session); !problem.empty())
    summary["problem"] = problem;
  WriteFile(out + "/summary.json", summary.dump(2) + "\n");
}

std::string FormatSummaryTable(const std::string& out) {
  const OrderedJson summary = ReadSummary(out);
  return SummaryTable(summary).Text();
}

}  // namespace mapmend

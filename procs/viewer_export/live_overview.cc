#include "procs/viewer_export/live_overview.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "libs/base/write_file.h"
#include "libs/map_view/level_frame.h"
#include "procs/viewer_export/gap_report.h"
#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/live_map.h"
#include "procs/viewer_export/mosaic_tiles.h"
#include "procs/viewer_export/restoration.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr size_t kMostGaps = 100;
constexpr size_t kMostRingPoints = 200;  // of the outline of a gap

std::string Share(double part, double whole) {
  if (whole <= 0) return "";
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f %%", 100 * part / whole);
  return text;
}

void PublishFigures(const Snapshot& snapshot, LiveFeed* feed) {
  const size_t main = snapshot.components.empty() ? 0 : snapshot.components[0].frames.size();
  const size_t points = snapshot.components.empty() ? 0 : ComponentPoints(snapshot, 0).size();
  size_t keyframes = 0, accepted = 0, losses = 0;
  for (const SnapshotSubmap& s : snapshot.submaps) {
    keyframes += s.submap->keyframes.size();
    losses += s.Lost() ? 1 : 0;
  }
  const std::vector<GraphEdge> connections = ListEdges(snapshot);
  for (const GraphEdge& e : connections)
    accepted += e.connection->verdict == EvaluatedConnection::Verdict::kAccepted ? 1 : 0;
  const int tracked = snapshot.num_frames_tracked, in = snapshot.num_frames_in;
  feed->Set("figures", JsonText({{"frames_in", in},
                                 {"frames_tracked", tracked},
                                 {"frames_in_main", main},
                                 {"share_tracked", Share(tracked, in)},
                                 {"share_in_main", Share(static_cast<double>(main), tracked)},
                                 {"submaps", snapshot.submaps.size()},
                                 {"losses", losses},
                                 {"parts", snapshot.components.size()},
                                 {"connections_accepted", accepted},
                                 {"connections_evaluated", connections.size()},
                                 {"keyframes", keyframes},
                                 {"points_in_main", points}}));
}

// Table 1 of the paper, as far as the flight has come.
void PublishRestoration(const Snapshot& snapshot, LiveFeed* feed) {
  Json rows = Json::array();
  const RestorationTable table = MakeRestorationTable(snapshot);
  const auto key = [&](int submap) { return PageKey(*snapshot.model, snapshot.submaps[submap].key); };
  for (const RestorationStep& step : table.steps) {
    const bool merges = step.event == RestorationStep::Event::kMerge;
    Json row = {{"utime", step.utime},
                {"frame", step.frame},
                {"event", merges ? "merge" : "new_map"},
                {"submap", key(step.submap)},
                {"L1", StackLetters(step.unrecovered)},
                {"L2", StackLetters(step.tracked)}};
    if (step.lost >= 0) row["lost"] = key(step.lost);
    // Which submaps are one map after the step: the page shows the map as it was.
    Json maps = Json::array();
    for (const auto* stack : {&step.unrecovered, &step.tracked}) {
      for (const std::vector<int>& map : *stack) {
        Json keys = Json::array();
        for (const int submap : map) keys.push_back(key(submap));
        maps.push_back(keys);
      }
    }
    row["maps"] = maps;
    rows.push_back(std::move(row));
  }
  feed->Set("restoration", JsonText(rows));
}

Json Ring(const std::vector<Eigen::Vector2d>& ring) {
  Json points = Json::array();
  const size_t step = 1 + ring.size() / kMostRingPoints;
  for (size_t i = 0; i < ring.size(); i += step) points.push_back({ring[i].x(), ring[i].y()});
  return points;
}

void PublishGaps(const GapReport& report, LiveFeed* feed) {
  Json list = Json::array();
  for (const Gap& gap : report.gaps) {
    if (list.size() >= kMostGaps) break;
    Json json = {{"text", gap.text}};
    json["kind"] = gap.kind == Gap::Kind::kGround    ? "ground"
                   : gap.kind == Gap::Kind::kStretch ? "stretch"
                                                     : "connection";
    if (gap.kind == Gap::Kind::kGround) {
      json["center"] = {gap.region.center.x(), gap.region.center.y()};
      json["rings"] = Json::array();
      for (const auto& ring : gap.region.rings) json["rings"].push_back(Ring(ring));
    } else if (gap.line.size() >= 2) {
      const Eigen::Vector3d middle = gap.line[gap.line.size() / 2];
      json["center"] = {middle.x(), middle.y()};
      json["line"] = Json::array();
      for (const Eigen::Vector3d& p : gap.line) json["line"].push_back({p.x(), p.y(), p.z()});
    }
    list.push_back(std::move(json));
  }
  feed->Set("gaps", JsonText({{"unit", report.Unit()},
                              {"placed", report.is_placed},
                              {"ground", report.has_ground},
                              {"area_seen", report.has_ground ? report.coverage.area_seen : 0},
                              {"list", list}}));
}

// The page shows parts upright: on the earth where that is known, with the frame of the gaps, else level.
void PublishFrames(const GapReport& gaps, Snapshot placed, Similarity3* main_frame, LiveFeed* feed) {
  std::set<std::string> names;
  for (int c = 0; c < static_cast<int>(placed.components.size()); ++c) {
    const SnapshotComponent& component = placed.components[c];
    if (component.keyframes.empty()) continue;
    std::string frame = component.frame.name, unit = component.frame.unit;
    Similarity3 page_from_root = component.frame_from_root;
    const bool has_gaps = gaps.has_ground && !gaps.is_placed && c == 0;
    if (has_gaps) {
      frame = "level";
      page_from_root = Similarity3(gaps.level_from_world);
    } else if (!component.frame.is_z_up) {
      PlaceLevel(c, &placed);
      frame = component.frame.name;
      page_from_root = component.frame_from_root;
    }
    const std::string name = "frame/" + PageKey(*placed.model, placed.submaps[component.root].key);
    feed->Set(name,
              JsonText({{"name", frame}, {"unit", unit}, {"part", c}, {"page_from_root", ToArray(page_from_root)}}));
    names.insert(name);
    if (c == 0) *main_frame = page_from_root;
  }
  feed->KeepOnly("frame/", names);
}

// The picture that the exports have made, with where it lies: its own frame is level, or a grid on the earth.
Json DescribePicture(const MapModel& model, const PlacementOptions& placement, const Similarity3& page_from_root,
                     const std::string& folder) {
  const Json mosaic = Json::parse(ReadFile(folder + "/mosaic.json"), nullptr, false);
  if (!mosaic.is_object() || !mosaic.contains("gsd")) return nullptr;
  Snapshot snapshot = MakeSnapshot(model);
  if (snapshot.components.empty()) return nullptr;
  Similarity3 picture_from_root;
  const std::string frame = mosaic.value("frame", "");
  if (frame == "level") {
    PlaceLevel(0, &snapshot);
  } else {
    const auto world = PlaceOnEarth(snapshot, placement);
    if (!world || !world->problem.empty()) return nullptr;
    PlaceOnEarth(*world, frame, &snapshot);
  }
  picture_from_root = snapshot.components[0].frame_from_root;
  const Eigen::Vector3d origin = snapshot.components[0].frame.origin;
  const double gsd = mosaic.value("gsd", 1.0), west = mosaic.value("west", 0.0) - origin.x(),
               north = mosaic.value("north", 0.0) - origin.y();
  return {{"kind", "picture"},
          {"url", "/files/mosaic.png"},
          {"west", west},
          {"north", north},
          {"east", west + gsd * mosaic.value("width", 0)},
          {"south", north - gsd * mosaic.value("height", 0)},
          {"page_from_picture", ToArray(page_from_root * picture_from_root.Inverse())}};
}

}  // namespace

void LiveOverview::PublishMosaic(const MapModel& model, LiveFeed* feed) {
  if (options_.files.empty() || Clock::now() < next_mosaic_) return;
  next_mosaic_ = Clock::now() + std::chrono::seconds(2);
  const std::string tiles = DescribeTiles(options_.files + "/" + kTilesFile);
  if (!tiles.empty()) return feed->Set("tiles", tiles);
  std::error_code error;
  const auto written = fs::last_write_time(options_.files + "/mosaic.json", error);
  if (error || !model.Revision().transforms.is_final) return;
  const std::string picture = std::to_string(written.time_since_epoch().count()) + "/" + std::to_string(version_);
  if (picture == mosaic_) return;
  mosaic_ = picture;
  const Json json = DescribePicture(model, options_.placement, main_frame_, options_.files);
  if (!json.is_null()) feed->Set("mosaic", JsonText(json));
}

void LiveOverview::Publish(const MapModel& model, bool is_final, LiveFeed* feed) {
  const auto begin = Clock::now();
  const bool became_final = is_final && !was_final_;
  if (model.Version() != version_ && (begin >= next_ || became_final)) {
    Snapshot snapshot = MakeSnapshot(model);
    PublishFigures(snapshot, feed);
    PublishRestoration(snapshot, feed);
    stacks_ = DescribeStacks(snapshot);
    const std::optional<WorldPlacement> world = PlaceOnEarth(snapshot, options_.placement);
    const bool is_placed = world && world->problem.empty();
    if (is_placed) PlaceOnEarth(*world, "enu", &snapshot);
    const GapReport gaps = FindGaps(snapshot, is_placed ? &*world : nullptr, options_.coverage);
    PublishGaps(gaps, feed);
    PublishFrames(gaps, std::move(snapshot), &main_frame_, feed);
    version_ = model.Version();
    was_final_ = is_final;
    const auto end = Clock::now();
    next_ = end + std::max<Clock::duration>(options_.min_pause, options_.pause_share * (end - begin));
  }
  PublishMosaic(model, feed);
}

}  // namespace mapmend

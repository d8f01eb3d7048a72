#include "procs/viewer_export/live_state.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "procs/viewer_export/graph_export.h"
#include "procs/viewer_export/restoration.h"
#include "procs/viewer_export/trajectory_picture.h"

namespace mapmend {
namespace {

using Json = nlohmann::json;

constexpr size_t kMostPictures = 6;  // parts of the map that are drawn

std::string Fixed(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", decimals, value);
  return text;
}

int CountLosses(const Snapshot& snapshot) {
  return static_cast<int>(std::count_if(snapshot.submaps.begin(), snapshot.submaps.end(),
                                        [](const SnapshotSubmap& s) { return s.Lost(); }));
}

// state: waiting, tracking, lost, merging, whole, parts; with a headline for it.
void AddHeadline(const Snapshot& snapshot, const LiveInputs& inputs, Json* json) {
  const MapModel& model = *snapshot.model;
  const FramePose& pose = inputs.Pose();
  std::string state, headline, detail;
  if (model.SessionOrder().empty()) {
    state = "waiting";
    headline = "Waiting for a flight";
    detail = "No frontend has started a session yet.";
  } else if (!model.AllEnded()) {
    const bool lost = pose.state == "lost";
    state = lost ? "lost" : "tracking";
    headline = lost ? "Tracking is lost" : pose.state == "initialising" ? "Looking for a start" : "Tracking";
    if (lost) detail = "A new submap begins as soon as the view allows; nothing mapped so far is lost.";
    if (pose.frame >= 0) headline += " · frame " + std::to_string(pose.frame);
    if (pose.state == "tracking") detail = std::to_string(pose.num_inliers) + " points support the pose.";
  } else if (!model.Revision().transforms.is_final) {
    state = "merging";
    headline = "Joining the submaps";
    detail = "The flight has ended; the merger compares all submaps and refines the map.";
  } else if (snapshot.components.size() <= 1) {
    state = "whole";
    headline = snapshot.submaps.empty() ? "There is no map" : "The map is in one piece";
    if (snapshot.submaps.empty()) detail = "Tracking never started.";
  } else {
    state = "parts";
    headline = "The map is in " + std::to_string(snapshot.components.size()) + " parts";
    detail = "The report says why they could not be joined.";
  }
  (*json)["state"] = state;
  (*json)["headline"] = headline;
  (*json)["detail"] = detail;
}

Json Figures(const Snapshot& snapshot) {
  Json figures = Json::array();
  const auto add = [&](const std::string& value, const std::string& label, const std::string& note) {
    figures.push_back({{"value", value}, {"label", label}, {"note", note}});
  };
  const double in = snapshot.num_frames_in;
  const size_t main = snapshot.components.empty() ? 0 : snapshot.components[0].frames.size();
  size_t keyframes = 0, points = 0, accepted = 0;
  for (const SnapshotSubmap& s : snapshot.submaps) {
    keyframes += s.submap->keyframes.size();
    points += s.submap->points.size();
  }
  const std::vector<GraphEdge> connections = ListEdges(snapshot);
  for (const GraphEdge& e : connections) accepted += e.connection->verdict == EvaluatedConnection::Verdict::kAccepted;
  const int losses = CountLosses(snapshot);
  add(std::to_string(snapshot.num_frames_tracked), "frames tracked",
      in > 0 ? Fixed(100 * snapshot.num_frames_tracked / in, 1) + " % of the flight" : "");
  add(std::to_string(main), "frames in the main map",
      snapshot.num_frames_tracked > 0
          ? Fixed(100.0 * static_cast<double>(main) / snapshot.num_frames_tracked, 1) + " % of tracked"
          : "");
  add(std::to_string(snapshot.submaps.size()), "submaps", std::to_string(losses) + (losses == 1 ? " loss" : " losses"));
  add(std::to_string(accepted), "connections", "of " + std::to_string(connections.size()) + " evaluated");
  add(std::to_string(keyframes), "keyframes", "");
  add(std::to_string(points), "map points", "");
  return figures;
}

Json Pictures(const Snapshot& snapshot, const LiveInputs& inputs, const GroundTruth* ground_truth) {
  Json pictures = Json::array();
  const int live_submap = snapshot.model->AllEnded() ? -1 : snapshot.FindSubmap(inputs.Pose().submap);
  for (size_t c = 0; c < snapshot.components.size() && pictures.size() < kMostPictures; ++c) {
    if (snapshot.components[c].frames.empty()) continue;
    TrajectoryPictureOptions options;
    Evaluation evaluation;
    if (ground_truth != nullptr) {
      evaluation = EvaluateTrajectory(ToTrajectory(snapshot.components[c].frames), ground_truth->trajectory,
                                      ground_truth->options);
      options.evaluation = &evaluation;
      options.ground_truth = &ground_truth->trajectory;
    }
    if (live_submap >= 0 && snapshot.submaps[live_submap].component == static_cast<int>(c)) {
      options.here = snapshot.submaps[live_submap].root_from_submap * inputs.Pose().cam_from_submap.Center();
    }
    pictures.push_back(MakeTrajectorySvg(snapshot, static_cast<int>(c), options));
  }
  return pictures;
}

// Table 1 of the paper, as far as the flight has come.
Json Restorations(const Snapshot& snapshot) {
  Json rows = Json::array();
  for (const RestorationStep& step : MakeRestorationTable(snapshot).steps) {
    const std::string submap = SubmapLetters(step.submap);
    const bool merges = step.event == RestorationStep::Event::kMerge;
    rows.push_back({{"frame", step.frame},
                    {"event", merges ? submap + " connected" : submap + " begun"},
                    {"L1", StackLetters(step.unrecovered)},
                    {"L2", StackLetters(step.tracked)}});
  }
  return rows;
}

Json Processes(const LiveInputs& inputs) {
  Json processes = Json::array();
  const auto now = std::chrono::steady_clock::now();
  for (const auto& [name, heard] : inputs.HealthOf()) {
    const Health& health = heard.health;
    std::string note;
    for (const auto& [counter, value] : health.counters) {
      note +=
          (note.empty() ? "" : ", ") + counter + " " + (value == std::floor(value) ? Fixed(value, 0) : Fixed(value, 1));
    }
    processes.push_back({{"name", name},
                         {"state", health.state},
                         {"message", health.message},
                         {"age_s", std::chrono::duration<double>(now - heard.arrival).count()},
                         {"cpu_s", health.cpu_s},
                         {"rss_mb", health.rss_mb},
                         {"note", note}});
  }
  return processes;
}

}  // namespace

void LiveInputs::OnHealth(const Health& health) {
  health_[health.process] = {health, std::chrono::steady_clock::now()};
}

std::string MakeLiveState(const MapModel& model, const LiveInputs& inputs, const GroundTruth* ground_truth,
                          bool exported, const std::string& gaps_svg) {
  const Snapshot snapshot = MakeSnapshot(model);
  Json json;
  AddHeadline(snapshot, inputs, &json);
  json["figures"] = Figures(snapshot);
  json["pictures"] = Pictures(snapshot, inputs, ground_truth);
  if (!gaps_svg.empty()) json["pictures"].push_back(gaps_svg);
  json["graph"] = MakeGraphSvg(snapshot);
  json["restoration"] = Restorations(snapshot);
  json["processes"] = Processes(inputs);
  json["report"] = exported;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace mapmend

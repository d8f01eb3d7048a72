#include "procs/viewer_export/live_state.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "libs/drawing/canvas.h"
#include "libs/merging/merging_time.h"
#include "libs/merging/restoration_log.h"
#include "procs/viewer_export/live_map.h"

namespace mapmend {
namespace {

using Json = nlohmann::json;

constexpr size_t kMostPairs = 60;  // of connected frames of an edge, that are listed

bool IsLost(const Submap& submap) { return submap.ended && submap.end_reason != "end_of_input"; }

struct Counts {
  int submaps = 0, growing = 0, parts = 0;
};

// Parts as the merger knows them; a submap that it does not know is one of its own.
Counts Count(const MapModel& model) {
  Counts counts;
  std::set<int> components;
  const auto& places = model.Revision().transforms.submaps;
  for (const std::string& id : model.SessionOrder()) {
    for (const auto& [number, submap] : model.GetSession(id).submaps) {
      ++counts.submaps;
      counts.growing += submap.ended ? 0 : 1;
      const SubmapKey key = {id, number};
      const auto place = std::find_if(places.begin(), places.end(), [&](const auto& p) { return p.key == key; });
      if (place == places.end()) {
        ++counts.parts;
      } else {
        components.insert(place->component);
      }
    }
  }
  counts.parts += static_cast<int>(components.size());
  return counts;
}

double CountKeyframes(const MapModel& model) {
  size_t count = 0;
  for (const std::string& id : model.SessionOrder()) {
    for (const auto& [number, submap] : model.GetSession(id).submaps) count += submap.keyframes.size();
  }
  return static_cast<double>(count);
}

// state: waiting, tracking, lost, merging, whole, parts, unmerged; with words for a person.
Json Headline(const MapModel& model, const FramePose& pose, const LiveRun& run) {
  const Counts counts = Count(model);
  const auto tell = [](const char* state, const std::string& headline, const std::string& detail) {
    return Json{{"state", state}, {"headline", headline}, {"detail", detail}};
  };
  if (model.SessionOrder().empty())
    return tell("waiting", "Waiting for a flight", "No frontend has started a session yet.");
  if (!model.AllEnded() && !run.is_stored) {
    if (pose.state == "lost") {
      return tell("lost", "Tracking is lost",
                  "A new submap begins as soon as the view allows; nothing mapped so far is lost.");
    }
    if (pose.state == "tracking")
      return tell("tracking", "Tracking", std::to_string(pose.num_inliers) + " points support the pose.");
    // A recording tells no poses.
    if (pose.frame < 0 && counts.growing > 0) return tell("tracking", "Tracking", "");
    return tell("starting", "Looking for a start", "A map begins as soon as two views show enough depth.");
  }
  if (!model.Revision().transforms.is_final) {
    if (run.is_stored)
      return tell("unmerged", "The map was not merged to the end", "The command mapmend merge makes the merged map.");
    return tell("merging", "Joining the submaps",
                "The flight has ended; the merger compares all submaps and refines the map.");
  }
  if (counts.submaps == 0) return tell("parts", "There is no map", "Tracking never started.");
  if (counts.parts <= 1) return tell("whole", "The map is in one piece", "");
  return tell("parts", "The map is in " + std::to_string(counts.parts) + " parts",
              "The graph and the report say why they could not be joined.");
}

void PublishRun(const MapModel& model, const LiveInputs& inputs, const LiveRun& run, LiveFeed* feed) {
  Json json = Headline(model, inputs.Pose(), run);
  json["folder"] = run.folder;
  json["report"] = run.exported && !run.folder.empty();
  json["can_decide"] = run.can_decide;
  json["is_stored"] = run.is_stored;
  json["ended"] = model.AllEnded();
  json["final"] = model.IsComplete();
  json["stopped"] = run.has_stopped;
  json["version"] = MAPMEND_VERSION;
  json["merging_estimate_s"] = EstimateMergingSeconds(CountKeyframes(model), 1);
  const MergedTransforms& merged = model.Revision().transforms;
  json["revision"] = merged.revision;
  json["refined"] = merged.refined;
  feed->Set("run", JsonText(json));
}

void PublishSessions(const MapModel& model, LiveFeed* feed) {
  for (size_t i = 0; i < model.SessionOrder().size(); ++i) {
    const Session& session = model.GetSession(model.SessionOrder()[i]);
    const Pinhole& camera = session.info.pinhole;
    feed->Set("session/" + std::to_string(i),
              JsonText({{"id", session.id},
                        {"vehicle", session.info.vehicle},
                        {"source", session.info.source},
                        {"start", session.start_utime},
                        {"last", model.LastUtime(session.id)},
                        {"ended", session.ended},
                        {"frames", session.ended ? session.num_frames : session.info.num_frames},
                        {"width", camera.width},
                        {"height", camera.height},
                        {"fx", camera.fx},
                        {"fy", camera.fy},
                        {"cx", camera.cx},
                        {"cy", camera.cy}}));
  }
}

Json DescribeSubmap(const SubmapKey& key, const Submap& submap, int session, int number) {
  Json json = {{"number", number},
               {"session", session},
               {"session_id", key.session},
               {"id", key.submap.value},
               {"color", CategoryColor(number)},
               {"ink", InkOn(CategoryColor(number))},
               {"ended", submap.ended},
               {"lost", IsLost(submap)},
               {"reason", submap.end_reason},
               {"detail", submap.end_detail},
               {"keyframes", submap.keyframes.size()},
               {"points", submap.points.size()},
               {"frames", submap.frames.size()}};
  if (!submap.frames.empty()) {
    // In the order of tracking: the first may have been tracked backwards later.
    const auto by_time = [](const TrackedFrame& a, const TrackedFrame& b) { return a.utime < b.utime; };
    const auto first =
        std::min_element(submap.frames.begin(),
                         submap.frames.begin() + std::min<std::ptrdiff_t>(64, std::ssize(submap.frames)), by_time);
    json["begin"] = first->utime;
    json["begin_frame"] = first->frame;
    json["end"] = std::max(submap.frames.back().utime, first->utime);
    json["end_frame"] = std::max(submap.frames.back().frame, first->frame);
  }
  return json;
}

void PublishSubmaps(const MapModel& model, LiveFeed* feed) {
  const auto& places = model.Revision().transforms.submaps;
  int offset = 0, letters = 0;
  for (size_t i = 0; i < model.SessionOrder().size(); ++i) {
    const Session& session = model.GetSession(model.SessionOrder()[i]);
    int highest = -1;
    for (const auto& [id, submap] : session.submaps) {
      const SubmapKey key = {session.id, id};
      Json json = DescribeSubmap(key, submap, static_cast<int>(i), offset + id.value);
      json["letters"] = SubmapLetters(letters++);
      const auto place = std::find_if(places.begin(), places.end(), [&](const auto& p) { return p.key == key; });
      if (place != places.end()) {
        json["component"] = place->component;
        json["root"] = place->is_root;
        json["place"] = ToArray(place->root_from_submap);
      }
      highest = std::max(highest, id.value);
      feed->Set("submap/" + PageKey(model, key), JsonText(json));
    }
    offset += highest + 1;
  }
}

bool IsDisabled(const EvaluatedConnection& connection, const std::vector<EdgeDecision>& decisions) {
  bool disabled = false;
  for (const EdgeDecision& d : decisions) {
    if ((d.a == connection.a && d.b == connection.b) || (d.a == connection.b && d.b == connection.a))
      disabled = d.disabled;
  }
  return disabled;
}

Json DescribeEdge(const MapModel& model, const EvaluatedConnection& c, bool disabled) {
  Json pairs = Json::array();
  for (const auto& pair : c.pairs) {
    if (pairs.size() < kMostPairs) pairs.push_back({pair.a.value, pair.b.value, pair.num_inliers});
  }
  // Connected from the first keyframe of the younger one on that sees the older one's ground.
  int64_t since = -1;
  for (const auto& pair : c.pairs) {
    const auto utime = model.FindKeyframeUtime(c.b.session, pair.b);
    if (utime && (since < 0 || *utime < since)) since = *utime;
  }
  return {{"a", PageKey(model, c.a)},
          {"b", PageKey(model, c.b)},
          {"verdict", ToString(c.verdict)},
          {"kind", ToString(KindOf(c))},
          {"weak", IsWeak(c)},
          {"reason", c.reason},
          {"tree", c.in_tree},
          {"F", c.num_connected_frames},
          {"M", c.num_common_points},
          {"theta", std::round(10 * c.median_angle_deg) / 10},
          {"C", std::round(10 * c.strength) / 10},
          {"inliers", c.num_inliers},
          {"candidates", c.num_candidates},
          {"error_px", std::round(100 * c.median_error_px) / 100},
          {"disabled", disabled},
          {"since", since},
          {"pairs", pairs}};
}

void PublishEdges(const MapModel& model, const std::vector<EdgeDecision>& decisions, LiveFeed* feed) {
  const auto is_known = [&](const SubmapKey& key) {
    const auto& order = model.SessionOrder();
    return std::find(order.begin(), order.end(), key.session) != order.end() &&
           model.GetSession(key.session).submaps.contains(key.submap);
  };
  std::set<std::string> names;
  for (const EvaluatedConnection& c : model.Revision().connections) {
    if (!is_known(c.a) || !is_known(c.b)) continue;
    const std::string name = "edge/" + PageKey(model, c.a) + "|" + PageKey(model, c.b);
    feed->Set(name, JsonText(DescribeEdge(model, c, IsDisabled(c, decisions))));
    names.insert(name);
  }
  feed->KeepOnly("edge/", names);
}

void PublishPose(const MapModel& model, const FramePose& pose, LiveFeed* feed) {
  const auto& order = model.SessionOrder();
  const bool is_tracked =
      pose.state == "tracking" && std::find(order.begin(), order.end(), pose.submap.session) != order.end();
  if (model.AllEnded() || pose.frame < 0) return feed->Erase("pose");
  Json json = {{"state", pose.state}, {"frame", pose.frame}, {"utime", pose.utime}, {"inliers", pose.num_inliers}};
  if (is_tracked) {
    json["submap"] = PageKey(model, pose.submap);
    json["cam_from_submap"] = ToArray(pose.cam_from_submap);
  }
  feed->Set("pose", JsonText(json));
}

// The newest record of each session that any process has told of.
std::map<std::string, int64_t> NewestRecords(const LiveInputs& inputs) {
  std::map<std::string, int64_t> newest;
  for (const auto& [name, heard] : inputs.HealthOf()) {
    for (const auto& [session, seq] : heard.health.cursors) {
      const auto [entry, is_new] = newest.emplace(session, seq);
      if (!is_new) entry->second = std::max(entry->second, seq);
    }
  }
  return newest;
}

// How many records of the sessions that it reads or writes it has still before it.
int64_t RecordsBehind(const Health& health, const std::map<std::string, int64_t>& newest) {
  int64_t behind = 0;
  for (const auto& [session, seq] : health.cursors) behind += newest.at(session) - seq;
  return behind;
}

void PublishProcesses(const MapModel& model, const LiveInputs& inputs, LiveFeed* feed) {
  const auto now = std::chrono::steady_clock::now();
  std::set<std::string> names;
  for (const auto& [name, heard] : inputs.HealthOf()) names.insert("process/" + name);
  feed->KeepOnly("process/", names);
  const std::map<std::string, int64_t> newest = NewestRecords(inputs);
  for (const auto& [name, heard] : inputs.HealthOf()) {
    const Health& health = heard.health;
    std::string vehicle;
    for (const auto& [session, seq] : health.cursors) {
      const auto& order = model.SessionOrder();
      if (health.process == "frontend" && std::find(order.begin(), order.end(), session) != order.end())
        vehicle = model.GetSession(session).info.vehicle;
    }
    // How long it has been silent, in coarse steps, so that it does not change with every look.
    const double silent = std::chrono::duration<double>(now - heard.arrival).count();
    const auto rounded = [](double value, double step) { return std::round(value / step) * step; };
    Json counters = Json::object();
    for (const auto& [counter, value] : health.counters) counters[counter] = rounded(value, 0.01);
    feed->Set("process/" + name, JsonText({{"name", health.process},
                                           {"vehicle", vehicle},
                                           {"pid", health.pid},
                                           {"host", health.host},
                                           {"state", health.state},
                                           {"message", health.message},
                                           {"silent_s", silent < 3 ? 0 : std::floor(silent / 5) * 5 + 3},
                                           {"cpu_s", rounded(health.cpu_s, 0.1)},
                                           {"rss_mb", rounded(health.rss_mb, 1)},
                                           {"queue", health.queue_depth},
                                           {"behind", RecordsBehind(health, newest)},
                                           {"counters", counters}}));
  }
}

}  // namespace

void LiveInputs::OnHealth(const Health& health) {
  static const std::string own_host = HostName();
  std::string name = health.process;
  if (health.host != own_host) name += "@" + health.host;
  // Several vehicles have a frontend each; one that was started again goes on in the same session.
  if (health.process == "frontend" && !health.cursors.empty()) {
    health_.erase(name);
    name = health.process + "/" + health.cursors.rbegin()->first;
  }
  health_[name] = {health, std::chrono::steady_clock::now()};
}

void LiveInputs::WasDeaf(std::chrono::steady_clock::duration time) {
  for (auto& [name, heard] : health_) heard.arrival += time;
}

void PublishState(const MapModel& model, const LiveInputs& inputs, const LiveRun& run, LiveFeed* feed) {
  PublishRun(model, inputs, run, feed);
  PublishPose(model, inputs.Pose(), feed);
  PublishProcesses(model, inputs, feed);
}

void PublishParts(const MapModel& model, const std::vector<EdgeDecision>& decisions, LiveFeed* feed) {
  PublishSessions(model, feed);
  PublishSubmaps(model, feed);
  PublishEdges(model, decisions, feed);
}

}  // namespace mapmend

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "tools/simulate/scenario.h"

namespace mapmend::simulate {
namespace {

namespace fs = std::filesystem;

// One mapping of a YAML file: every key must be asked for, what is left over is unknown.
class Section {
 public:
  Section(std::string file, std::string prefix, YAML::Node node)
      : file_(std::move(file)), prefix_(std::move(prefix)), node_(std::move(node)) {
    if (node_.IsDefined() && !node_.IsNull() && !node_.IsMap()) Fail("", "must be a mapping of keys to values");
  }

  [[noreturn]] void Fail(const std::string& key, const std::string& what) const {
    throw std::runtime_error("scenario " + file_ + ": key " + prefix_ + key + " " + what);
  }
  bool Has(const std::string& key) {
    known_.insert(key);
    return node_.IsMap() && node_[key].IsDefined();
  }
  YAML::Node Get(const std::string& key) { return node_[key]; }
  Section Sub(const std::string& key) { return {file_, prefix_ + key + ".", Has(key) ? node_[key] : YAML::Node()}; }
  std::string Path(const std::string& key) const { return prefix_ + key; }
  const std::string& File() const { return file_; }

  template <typename T>
  void Read(const std::string& key, T* value) {
    if (!Has(key)) return;
    try {
      *value = node_[key].as<T>();
    } catch (const YAML::Exception&) {
      const char* wanted = std::is_same_v<T, bool>          ? "must be true or false"
                           : std::is_same_v<T, std::string> ? "must be text"
                           : std::is_integral_v<T>          ? "must be a whole number"
                                                            : "must be a number";
      Fail(key, wanted);
    }
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(*value)) Fail(key, "must be finite");
    }
  }
  void ReadVector(const std::string& key, Eigen::Vector3d* value) {
    if (!Has(key)) return;
    std::vector<double> numbers;
    try {
      numbers = node_[key].as<std::vector<double>>();
    } catch (const YAML::Exception&) {
    }
    if (numbers.size() != 3) Fail(key, "must be three numbers, [x, y, z]");
    *value = {numbers[0], numbers[1], numbers[2]};
  }
  // value = the index of the text among the choices.
  template <typename Enum>
  void ReadChoice(const std::string& key, const std::vector<std::string>& choices, Enum* value) {
    if (!Has(key)) return;
    std::string text, all;
    Read(key, &text);
    const auto found = std::find(choices.begin(), choices.end(), text);
    for (const auto& choice : choices) all += (all.empty() ? "" : ", ") + choice;
    if (found == choices.end()) Fail(key, "is \"" + text + "\"; known are " + all);
    *value = static_cast<Enum>(found - choices.begin());
  }
  void CheckKnown() const {
    if (!node_.IsMap()) return;
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>();
      if (known_.contains(key)) continue;
      std::string all;
      for (const auto& name : known_) all += (all.empty() ? "" : ", ") + name;
      Fail(key, "is not known; known here are " + all);
    }
  }

 private:
  std::string file_, prefix_;
  YAML::Node node_;
  std::set<std::string> known_;
};

const std::vector<std::string> kEventNames = {"gust", "drop", "blackout", "overexposure", "water", "whip_pan", "skip"};

void ReadCameraSection(Section s, Camera* camera) {
  s.ReadChoice("model", {"pinhole", "fisheye"}, &camera->model);
  const int width = camera->width, height = camera->height;
  s.Read("width", &camera->width);
  s.Read("height", &camera->height);
  s.Read("fx", &camera->fx);
  camera->fy = s.Has("fx") ? camera->fx : camera->fy;
  s.Read("fy", &camera->fy);
  if (width != camera->width || height != camera->height) {
    camera->cx = (camera->width - 1) / 2.0;
    camera->cy = (camera->height - 1) / 2.0;
  }
  s.Read("cx", &camera->cx);
  s.Read("cy", &camera->cy);
  const bool fisheye = camera->model == Camera::Model::kFisheye;
  const char* names[] = {"k1", "k2", fisheye ? "k3" : "p1", fisheye ? "k4" : "p2", "k3"};
  for (int i = 0; i < (fisheye ? 4 : 5); ++i) s.Read(names[i], &camera->distortion[i]);
  s.CheckKnown();
}

void ReadTwin(Section twin, const Section& scene, AerialOptions* a) {
  Twin& t = a->twin;
  twin.Read("from_x", &t.from_x);
  twin.Read("from_y", &t.from_y);
  twin.Read("to_x", &t.to_x);
  twin.Read("to_y", &t.to_y);
  twin.Read("size", &t.size);
  twin.CheckKnown();
  const auto inside = [&](double x, double y) {
    return x >= a->x0 && y >= a->y0 && x + t.size <= a->x0 + a->width && y + t.size <= a->y0 + a->length;
  };
  if (t.size < 0) scene.Fail("twin", "needs a size that is not negative");
  if (t.size > 0 && !(inside(t.from_x, t.from_y) && inside(t.to_x, t.to_y))) {
    scene.Fail("twin", "has a square outside the area that is modelled");
  }
}

void ReadScene(Section s, SceneOptions* scene) {
  AerialOptions& a = scene->aerial;
  s.ReadChoice("kind", {"aerial", "street", "office", "corridor"}, &scene->kind);
  s.Read("seed", &a.seed);
  s.Read("x0", &a.x0);
  s.Read("y0", &a.y0);
  s.Read("width", &a.width);
  s.Read("length", &a.length);
  scene->width = a.width;
  scene->length = a.length;
  s.Read("texel", &a.texel);
  s.Read("spacing", &a.spacing);
  s.Read("relief", &a.relief);
  s.Read("trees", &a.trees);
  s.Read("roughness", &a.roughness);
  s.Read("grain", &a.grain);
  s.Read("foliage", &a.foliage);
  s.Read("leaf_angle", &a.leaf_angle);
  s.Read("leaf_time", &a.leaf_time);
  s.Read("road_spacing", &a.road_spacing);
  s.Read("houses", &a.houses);
  s.Read("park", &a.park);
  s.Read("fields", &a.fields);
  s.Read("marsh", &a.marsh);
  s.Read("forest", &a.forest);
  s.Read("repeat_x", &a.repeat_x);
  ReadTwin(s.Sub("twin"), s, &a);
  if (s.Has("lakes")) {
    a.lakes.clear();
    for (const auto& node : s.Get("lakes")) {
      Section lake(s.File(), s.Path("lakes") + ".", node);
      Lake l;
      lake.Read("x", &l.x);
      lake.Read("y", &l.y);
      lake.Read("radius_x", &l.radius_x);
      lake.Read("radius_y", &l.radius_y);
      lake.CheckKnown();
      if (l.radius_x <= 0 || l.radius_y <= 0) s.Fail("lakes", "needs positive radius_x and radius_y");
      a.lakes.push_back(l);
    }
  }
  s.CheckKnown();
}

void ReadTrajectorySection(Section s, TrajectoryOptions* t) {
  s.ReadChoice("kind", {"survey", "circle", "path"}, &t->kind);
  s.Read("speed", &t->speed);
  s.Read("tilt_deg", &t->tilt_deg);
  s.Read("smoothing", &t->smoothing);
  s.Read("turn_rate", &t->turn_rate);
  s.ReadVector("start", &t->start);
  s.Read("heading_deg", &t->heading_deg);
  s.Read("strip_length", &t->strip_length);
  s.Read("spacing", &t->spacing);
  s.Read("strips", &t->strips);
  s.Read("turn", &t->turn);
  s.Read("radius", &t->radius);
  s.Read("turns", &t->turns);
  if (s.Has("points")) {
    t->points.clear();
    if (!s.Get("points").IsSequence()) s.Fail("points", "must be a list");
    for (const auto& node : s.Get("points")) {
      Section point(s.File(), s.Path("points") + ".", node);
      Waypoint w;
      point.ReadVector("at", &w.position);
      double value = 0;
      if (point.Has("heading_deg")) point.Read("heading_deg", &value), w.heading_deg = value;
      if (point.Has("tilt_deg")) point.Read("tilt_deg", &value), w.tilt_deg = value;
      point.Read("hold", &w.hold);
      point.CheckKnown();
      t->points.push_back(w);
    }
  }
  s.CheckKnown();
}

void ReadEvents(Section* root, Scenario* scenario) {
  if (root->Has("events")) {
    scenario->events.clear();
    const YAML::Node list = root->Get("events");
    if (!list.IsSequence()) root->Fail("events", "must be a list ([] for none)");
    for (const auto& node : list) {
      Section s(root->File(), "events.", node);
      Event event;
      if (!s.Has("kind")) s.Fail("kind", "is missing");
      s.ReadChoice("kind", kEventNames, &event.kind);
      s.Read("at", &event.at);
      s.Read("duration", &event.duration);
      s.Read("amount", &event.amount);
      s.CheckKnown();
      scenario->events.push_back(event);
    }
  }
  Section s = root->Sub("random_events");
  s.Read("count", &scenario->random_events.count);
  s.Read("margin", &scenario->random_events.margin);
  s.Read("duration", &scenario->random_events.duration);
  if (s.Has("kinds")) {
    scenario->random_events.kinds.clear();
    for (const auto& node : s.Get("kinds")) {
      const auto found = std::find(kEventNames.begin(), kEventNames.end(), node.as<std::string>());
      if (found == kEventNames.end()) s.Fail("kinds", "has the unknown kind " + node.as<std::string>());
      scenario->random_events.kinds.push_back(static_cast<Event::Kind>(found - kEventNames.begin()));
    }
  }
  s.CheckKnown();
}

std::string Resolve(const std::string& file_or_name, const std::string& folder) {
  if (fs::is_regular_file(file_or_name)) return file_or_name;
  if (file_or_name.find('/') != std::string::npos || file_or_name.ends_with(".yaml")) {
    throw std::runtime_error("scenario " + file_or_name + ": no such file");
  }
  const std::string path = folder + "/" + file_or_name + ".yaml";
  if (fs::is_regular_file(path)) return path;
  std::string all;
  for (const auto& [name, description] : ListScenarios(folder)) all += (all.empty() ? "" : ", ") + name;
  throw std::runtime_error("scenario " + file_or_name + " is not known; known are " + all + ", or give a file");
}

void ReadShake(Section s, ShakeOptions* options) {
  s.Read("attitude_deg", &options->attitude_deg);
  s.Read("position", &options->position);
  s.Read("corner_hz", &options->corner_hz);
  s.Read("vibration_deg", &options->vibration_deg);
  s.Read("gait_hz", &options->gait_hz);
  s.Read("gait", &options->gait);
  s.CheckKnown();
}

void ReadSensor(Section s, SensorOptions* options) {
  s.Read("exposure_ms", &options->exposure_ms);
  s.Read("readout_ms", &options->readout_ms);
  s.Read("noise", &options->noise);
  s.Read("vignetting", &options->vignetting);
  s.Read("exposure_drift", &options->exposure_drift);
  s.Read("white_balance_drift", &options->white_balance_drift);
  s.Read("lod_bias", &options->lod_bias);
  s.Read("motion_blur", &options->motion_blur);
  s.Read("sharpening", &options->sharpening);
  s.Read("haze", &options->haze);
  s.CheckKnown();
}

void ReadOutput(Section s, OutputOptions* options) {
  s.Read("images", &options->images);
  s.Read("crf", &options->crf);
  s.Read("gps_noise", &options->gps_noise);
  s.Read("gps_origin_lat", &options->gps_origin_lat);
  s.Read("gps_origin_lon", &options->gps_origin_lon);
  s.Read("gps_origin_alt", &options->gps_origin_alt);
  s.CheckKnown();
}

void ReadInto(const std::string& path, const std::string& folder, int depth, Scenario* scenario) {
  if (depth > 8) throw std::runtime_error("scenario " + path + ": key base names itself");
  YAML::Node node;
  try {
    node = YAML::LoadFile(path);
  } catch (const YAML::Exception& e) {
    throw std::runtime_error("scenario " + path + ": is not YAML: " + e.what());
  }
  Section root(path, "", node);
  std::string base;
  root.Read("base", &base);
  if (!base.empty()) ReadInto(Resolve(base, folder), folder, depth + 1, scenario);
  scenario->name = fs::path(path).stem().string();
  root.Read("description", &scenario->description);
  root.Read("seed", &scenario->seed);
  root.Read("frames", &scenario->frames);
  root.Read("fps", &scenario->fps);
  root.Read("start_time", &scenario->start_time);
  ReadCameraSection(root.Sub("camera"), &scenario->camera);
  ReadScene(root.Sub("scene"), &scenario->scene);
  ReadTrajectorySection(root.Sub("trajectory"), &scenario->trajectory);
  ReadShake(root.Sub("shake"), &scenario->shake);
  ReadSensor(root.Sub("sensor"), &scenario->sensor);
  ReadEvents(&root, scenario);
  ReadOutput(root.Sub("output"), &scenario->output);
  root.CheckKnown();
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ListScenarios(const std::string& folder) {
  std::vector<std::pair<std::string, std::string>> list;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() != ".yaml") continue;
    std::string description;
    try {
      const YAML::Node node = YAML::LoadFile(entry.path().string());
      if (node["description"]) description = node["description"].as<std::string>();
    } catch (const YAML::Exception&) {
      description = "(not readable)";
    }
    list.emplace_back(entry.path().stem().string(), description);
  }
  std::sort(list.begin(), list.end());
  return list;
}

Scenario ReadScenario(const std::string& file_or_name, const std::string& folder) {
  Scenario scenario;
  scenario.camera.width = scenario.camera.height = 0;
  ReadInto(Resolve(file_or_name, folder), folder, 0, &scenario);
  scenario.Check();
  return scenario;
}

}  // namespace mapmend::simulate

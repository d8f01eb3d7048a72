#include "tools/simulate/scenario.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "tools/simulate/random.h"

namespace mapmend::simulate {
namespace {

double LowestHeight(const TrajectoryOptions& trajectory) {
  if (trajectory.kind != TrajectoryOptions::Kind::kPath || trajectory.points.empty()) return trajectory.start.z();
  double lowest = trajectory.points[0].position.z();
  for (const Waypoint& point : trajectory.points) lowest = std::min(lowest, point.position.z());
  return lowest;
}

// Throws, in the scenario's name, unless ok.
using Require = std::function<void(bool ok, const std::string& what)>;

void CheckCamera(const Camera& camera, const Require& require) {
  require(camera.width >= 16 && camera.height >= 16 && camera.width <= 8192 && camera.height <= 8192,
          "camera.width and camera.height must lie in 16 to 8192");
  require(camera.width % 2 == 0 && camera.height % 2 == 0, "camera.width and camera.height must be even (H.264)");
  require(camera.fx > 0 && camera.fy > 0, "camera.fx and camera.fy (focal lengths) must be positive");
  require(camera.cx >= 0 && camera.cx < camera.width && camera.cy >= 0 && camera.cy < camera.height,
          "camera.cx and camera.cy must lie in the image");
}

void CheckSensor(const SensorOptions& sensor, double fps, const Require& require) {
  require(sensor.exposure_ms >= 0 && sensor.readout_ms >= 0,
          "sensor.exposure_ms and sensor.readout_ms must not be negative");
  require(sensor.exposure_ms <= 1000 / fps && sensor.readout_ms <= 1000 / fps,
          "sensor.exposure_ms and sensor.readout_ms must not exceed a frame");
  require(sensor.noise >= 0 && sensor.vignetting >= 0 && sensor.vignetting < 1,
          "sensor.noise must not be negative, sensor.vignetting must lie in [0, 1)");
  require(sensor.haze >= 0 && sensor.haze < 1, "sensor.haze must lie in [0, 1)");
  require(sensor.sharpening >= 0 && sensor.sharpening <= 10, "sensor.sharpening must lie in 0 to 10");
}

void CheckTrajectory(const TrajectoryOptions& trajectory, const Require& require) {
  require(trajectory.speed > 0, "trajectory.speed must be positive");
  require(trajectory.smoothing >= 0.02, "trajectory.smoothing must be at least 0.02 s");
  require(trajectory.turn_rate > 0, "trajectory.turn_rate must be positive");
  require(trajectory.kind != TrajectoryOptions::Kind::kSurvey || (trajectory.strips > 0 && trajectory.strip_length > 0),
          "trajectory.strips and trajectory.strip_length must be positive");
  require(trajectory.kind != TrajectoryOptions::Kind::kCircle || trajectory.radius > 0,
          "trajectory.radius must be positive");
  require(trajectory.kind != TrajectoryOptions::Kind::kPath || !trajectory.points.empty(),
          "trajectory.points must not be empty");
  if (trajectory.kind != TrajectoryOptions::Kind::kPath) {
    require(trajectory.start.z() > 0, "trajectory.start: the height must be positive");
  }
  for (const Waypoint& point : trajectory.points)
    require(point.position.z() > 0, "trajectory.points: every height must be positive");
}

void CheckScene(const SceneOptions& scene, const Require& require) {
  const AerialOptions& a = scene.aerial;
  require(a.texel > 0 && a.spacing > 0, "scene.texel and scene.spacing must be positive");
  require(a.width / a.texel * a.length / a.texel < 4e8,
          "scene: width x length is too large for scene.texel (more than 400 million texels)");
  require(a.width >= 8 * a.spacing && a.length >= 8 * a.spacing && scene.width > 0 && scene.length > 0,
          "scene.width and scene.length must be positive");
  require(a.road_spacing >= 50, "scene.road_spacing must be at least 50 m");
  require(a.relief >= 0, "scene.relief must not be negative");
  require(a.trees >= 0 && a.trees <= 10, "scene.trees must lie in 0 to 10");
  require(a.roughness >= 0 && a.roughness <= 3, "scene.roughness must lie in 0 to 3 m");
  require(a.grain >= 0 && a.grain <= 1, "scene.grain must lie in 0 to 1");
  require(a.foliage >= 0 && a.foliage <= 0.5, "scene.foliage must lie in 0 to 0.5");
  require(a.leaf_angle > 0 && a.leaf_time > 0, "scene.leaf_angle and scene.leaf_time must be positive");
  require(a.houses >= 0 && a.park >= 0 && a.fields >= 0 && a.marsh >= 0 && a.forest >= 0 &&
              a.houses + a.park + a.fields + a.marsh + a.forest > 0,
          "scene: the shares of houses, park, fields, marsh and forest must not be negative or all zero");
}

}  // namespace

const char* EventName(Event::Kind kind) {
  switch (kind) {
    case Event::Kind::kGust:
      return "gust";
    case Event::Kind::kDrop:
      return "drop";
    case Event::Kind::kBlackout:
      return "blackout";
    case Event::Kind::kOverexposure:
      return "overexposure";
    case Event::Kind::kWater:
      return "water";
    case Event::Kind::kWhipPan:
      return "whip_pan";
    case Event::Kind::kSkip:
      return "skip";
  }
  return "";
}

void Scenario::Check() const {
  const Require require = [this](bool ok, const std::string& what) {
    if (!ok) throw std::runtime_error("scenario " + name + ": " + what);
  };
  require(frames > 0, "frames must be positive");
  require(fps > 0 && fps <= 1000, "fps must lie in (0, 1000]");
  CheckCamera(camera, require);
  CheckSensor(sensor, fps, require);
  CheckTrajectory(trajectory, require);
  require(shake.corner_hz > 0, "shake.corner_hz must be positive");
  require(shake.attitude_deg >= 0 && shake.position >= 0 && shake.vibration_deg >= 0 && shake.gait_hz >= 0,
          "shake: no amplitude may be negative");
  CheckScene(scene, require);
  for (const Event& event : events) {
    require(event.at >= 0 && event.duration > 0,
            std::string("events: at must not be negative and duration positive (") + EventName(event.kind) + ")");
  }
  require(output.crf >= 0 && output.crf <= 51, "output.crf must lie in 0 to 51");
  require(random_events.count == 0 || (!random_events.kinds.empty() && random_events.duration > 0),
          "random_events needs kinds and a positive duration");
}

void PlaceRandomEvents(Scenario* scenario) {
  const RandomEvents& wanted = scenario->random_events;
  const double length = scenario->frames / scenario->fps;
  Random random(Hash(scenario->seed, 31));
  // One event per equal part of the run, anywhere in the part but for the margins.
  const double part = (length - wanted.margin) / std::max(1, wanted.count);
  if (wanted.count > 0 && part < wanted.margin + wanted.duration) {
    throw std::runtime_error("scenario " + scenario->name +
                             ": random_events.count is too large for the length of the run");
  }
  for (int i = 0; i < wanted.count; ++i) {
    Event event;
    event.kind = wanted.kinds[random.Int(static_cast<int>(wanted.kinds.size()))];
    event.duration = wanted.duration;
    event.at = wanted.margin + i * part + random.Uniform() * (part - wanted.margin - wanted.duration);
    scenario->events.push_back(event);
  }
  scenario->random_events.count = 0;
  for (Event& event : scenario->events) {
    if (event.amount != 0) continue;
    switch (event.kind) {
      case Event::Kind::kGust:
        event.amount = 40;
        break;
      case Event::Kind::kWhipPan:
        event.amount = 120;
        break;
      case Event::Kind::kDrop:
        event.amount = 0.6 * LowestHeight(scenario->trajectory);
        break;
      case Event::Kind::kOverexposure:
        event.amount = 40;
        break;
      default:
        break;
    }
  }
}

}  // namespace mapmend::simulate

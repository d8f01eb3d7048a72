#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "libs/geometry/camera.h"
#include "tools/simulate/aerial.h"

namespace mapmend::simulate {

struct Waypoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::optional<double> heading_deg;  // counter-clockwise from east; along the path if absent
  std::optional<double> tilt_deg;     // below the horizon, 90 is straight down; the trajectory's if absent
  double hold = 0;                    // seconds of rest here
};

struct TrajectoryOptions {
  enum class Kind { kSurvey, kCircle, kPath };
  Kind kind = Kind::kSurvey;
  double speed = 8;       // m/s
  double tilt_deg = 90;   // camera below the horizon
  double smoothing = 1;   // seconds over which corners are rounded
  double turn_rate = 60;  // degrees a second where the heading changes at a corner
  // survey: S-shaped strips, the first from start along heading, the others to its left (or right if spacing is
  // negative)
  Eigen::Vector3d start = {0, 0, 70};
  double heading_deg = 0;
  double strip_length = 100, spacing = 20;
  int strips = 4;
  bool turn = false;  // the camera turns with the path; otherwise it keeps its heading
  // circle: about start
  double radius = 50, turns = 1;
  // path
  std::vector<Waypoint> points;
};

struct ShakeOptions {
  double attitude_deg = 0.4;    // RMS of wind in each angle
  double position = 0.15;       // RMS of wind in each axis, metres
  double corner_hz = 0.4;       // of the Dryden spectrum
  double vibration_deg = 0.01;  // RMS, 20 to 60 Hz
  double gait_hz = 0;           // steps a second; 0: nobody walks
  double gait = 0.03;           // metres up and down, half as much sideways
};

struct Event {
  enum class Kind { kGust, kDrop, kBlackout, kOverexposure, kWater, kWhipPan, kSkip };
  Kind kind = Kind::kSkip;
  double at = 0, duration = 1;  // seconds
  double amount = 0;            // degrees (gust, whip_pan), metres (drop), factor of light (overexposure)
};
const char* EventName(Event::Kind kind);

struct RandomEvents {
  int count = 0;
  double margin = 5, duration = 2;  // seconds: from either end and between two; of each
  std::vector<Event::Kind> kinds;
};

struct SensorOptions {
  double exposure_ms = 2, readout_ms = 0;
  double noise = 2.0, vignetting = 0.2;
  double exposure_drift = 0.08, white_balance_drift = 0.03;  // relative, RMS, over tens of seconds
  double lod_bias = -0.4;
  double sharpening = 0, haze = 0;
  bool motion_blur = true;
};

struct SceneOptions {
  enum class Kind { kAerial, kStreet, kOffice, kCorridor };
  Kind kind = Kind::kAerial;
  AerialOptions aerial;
  // street: a rectangle of streets; corridor: a loop; office: one room. Metres.
  double width = 60, length = 40;
};

struct OutputOptions {
  bool images = false;  // a folder of PNG files in place of a video
  int crf = 21;         // H.264 quality, 0 to 51, lower is better
  double gps_noise = 1.2, gps_origin_lat = 34.03, gps_origin_lon = 108.76, gps_origin_alt = 420;
};

struct Scenario {
  std::string name, description;
  uint64_t seed = 1;
  int frames = 100;
  double fps = 10;
  double start_time = 0;  // of the first frame, seconds
  Camera camera;
  SceneOptions scene;
  TrajectoryOptions trajectory;
  ShakeOptions shake;
  SensorOptions sensor;
  std::vector<Event> events;
  RandomEvents random_events;
  OutputOptions output;

  // Throws std::runtime_error with one line that names the key that is impossible and why.
  void Check() const;
};

// Reads a scenario from a file, or by name from folder/NAME.yaml. A scenario may name another as its `base` and then
// says only what differs. Throws std::runtime_error with one line that names the file and the unknown or wrong key; for
// an unknown name it lists those there are.
Scenario ReadScenario(const std::string& file_or_name, const std::string& folder);
// Names in the folder, sorted, with their descriptions.
std::vector<std::pair<std::string, std::string>> ListScenarios(const std::string& folder);
// The folder of data/scenarios and data/simulator: beside the program's share folder, or in the source tree.
std::string FindDataFolder();

// Turns random_events into events, by the scenario's seed.
void PlaceRandomEvents(Scenario* scenario);

}  // namespace mapmend::simulate

#include "tools/simulate/simulator.h"

#include <cmath>
#include <numbers>

#include "tools/simulate/indoor.h"
#include "tools/simulate/random.h"
#include "tools/simulate/street.h"

namespace mapmend::simulate {
namespace {

Scenario Prepare(Scenario scenario) {
  PlaceRandomEvents(&scenario);
  return scenario;
}

// A lake under the camera's path for every event `water`, wide enough that a frame in its middle shows nothing else.
void AddLakes(const CameraMotion& motion, Scenario* scenario) {
  for (const Event& event : scenario->events) {
    if (event.kind != Event::Kind::kWater || scenario->scene.kind != SceneOptions::Kind::kAerial) continue;
    const auto middle = motion.Path(event.at + event.duration / 2);
    const auto before = motion.Path(event.at), after = motion.Path(event.at + event.duration);
    const Camera& camera = scenario->camera;
    const double tilt = middle[4], reach = middle[2] / std::max(0.2, std::tan(tilt));
    const double half =
        middle[2] / std::sin(tilt) * 0.5 * std::hypot(camera.width / camera.fx, camera.height / camera.fy);
    const double dx = after[0] - before[0], dy = after[1] - before[1];
    Lake lake;
    lake.x = middle[0] + reach * std::cos(middle[3]);
    lake.y = middle[1] + reach * std::sin(middle[3]);
    lake.yaw = std::hypot(dx, dy) > 0.1 ? std::atan2(dy, dx) : 0;
    lake.radius_x = 1.2 * (half + 0.5 * std::hypot(dx, dy));
    lake.radius_y = 1.2 * half;
    scenario->scene.aerial.lakes.push_back(lake);
  }
}

std::unique_ptr<Scene> BuildScene(const Scenario& scenario, const std::string& data_folder, int num_threads) {
  const MaterialLibrary materials(data_folder + "/simulator");
  AerialOptions aerial = scenario.scene.aerial;
  aerial.num_threads = num_threads;
  switch (scenario.scene.kind) {
    case SceneOptions::Kind::kAerial:
      return BuildAerialScene(aerial, materials);
    case SceneOptions::Kind::kStreet:
      return BuildStreetScene(scenario.scene.width, scenario.scene.length, aerial.seed, materials, num_threads);
    case SceneOptions::Kind::kOffice:
      return BuildOfficeScene(scenario.scene.width, scenario.scene.length, aerial.seed, materials, num_threads);
    case SceneOptions::Kind::kCorridor:
      return BuildCorridorScene(scenario.scene.width, scenario.scene.length, aerial.seed, materials, num_threads);
  }
  return nullptr;
}

// Smooth and slow, RMS about 1.
double Drift(double time, double period, uint64_t seed) { return 1.9 * ValueNoise(time / period, 0.5, seed); }

}  // namespace

Simulator::Simulator(const Scenario& scenario, const std::string& data_folder, int num_threads)
    : scenario_(Prepare(scenario)), num_threads_(num_threads), motion_(scenario_) {
  AddLakes(motion_, &scenario_);
  scene_ = BuildScene(scenario_, data_folder, num_threads);
  RenderOptions options;
  options.exposure = scenario_.sensor.exposure_ms * 1e-3;
  options.readout = scenario_.sensor.readout_ms * 1e-3;
  options.lod_bias = scenario_.sensor.lod_bias;
  options.haze = static_cast<float>(scenario_.sensor.haze);
  options.sharpening = scenario_.sensor.sharpening;
  options.motion_blur = scenario_.sensor.motion_blur;
  options.num_threads = num_threads;
  renderer_ = std::make_unique<Renderer>(scene_.get(), scenario_.camera, options);
}

void Simulator::Render(int index, Frame* frame) {
  renderer_->Render([this](double time) { return motion_.WorldFromCamera(time); }, Time(index), Sensor(index), frame);
}

int64_t Simulator::Utime(int index) const { return std::llround((scenario_.start_time + Time(index)) * 1e6); }

bool Simulator::LeftOut(int index) const {
  for (const Event& event : scenario_.events) {
    if (event.kind == Event::Kind::kSkip && Time(index) >= event.at && Time(index) < event.at + event.duration)
      return true;
  }
  return false;
}

SensorState Simulator::Sensor(int index) const {
  const SensorOptions& o = scenario_.sensor;
  const double time = Time(index);
  const uint64_t seed = Hash(scenario_.seed, 51);
  double gain = std::exp2(o.exposure_drift * Drift(time, 11, seed));
  double noise = o.noise;
  for (const Event& event : scenario_.events) {
    const double into = time - event.at, left = event.at + event.duration - time;
    const double ramp = std::clamp(std::min(into, left) / std::min(0.15, event.duration / 4), 0.0, 1.0);
    if (ramp <= 0) continue;
    if (event.kind == Event::Kind::kBlackout) gain *= std::pow(1e-3, ramp);
    if (event.kind == Event::Kind::kOverexposure) gain *= std::pow(std::max(event.amount, 1e-3), ramp);
  }
  SensorState state;
  state.gain[0] = static_cast<float>(gain * (1 + o.white_balance_drift * Drift(time, 23, seed + 1)));
  state.gain[1] = static_cast<float>(gain);
  state.gain[2] = static_cast<float>(gain * (1 + o.white_balance_drift * Drift(time, 29, seed + 2)));
  state.noise = static_cast<float>(noise);
  state.vignetting = static_cast<float>(o.vignetting);
  state.seed = Hash(scenario_.seed, 61, static_cast<uint64_t>(index));
  return state;
}

}  // namespace mapmend::simulate

#pragma once

#include <array>
#include <vector>

#include "libs/geometry/rigid3.h"
#include "tools/simulate/scenario.h"

namespace mapmend::simulate {

// The pose of the camera at any time: a path with rounded corners, wind or steps, and the events that move the camera.
// A pure, smooth function (continuous acceleration but at the ends), so that sub-frame poses are as true as those of
// frames.
class CameraMotion {
 public:
  explicit CameraMotion(const Scenario& scenario);

  Rigid3 WorldFromCamera(double time) const;
  // Without wind and events: x, y, z, heading, tilt (radians).
  std::array<double, 5> Path(double time) const;
  // When the path is flown out; afterwards the camera rests.
  double Duration() const { return keys_.back().time; }

 private:
  struct Key {
    double time;
    std::array<double, 5> value;
    std::array<double, 5> first, second;  // the integral and the integral of the integral up to here
  };
  struct Wave {
    double frequency, phase, amplitude;  // rad/s
  };

  void AddKey(double seconds_later, const std::array<double, 5>& value);
  void BuildSurvey(const TrajectoryOptions& options);
  void BuildCircle(const TrajectoryOptions& options);
  void BuildPath(const TrajectoryOptions& options);
  std::array<double, 5> SecondIntegral(double time) const;

  std::vector<Key> keys_;
  double half_width_;                       // of the smoothing triangle, seconds
  std::array<std::vector<Wave>, 6> waves_;  // x, y, z; about x, y, z of the camera
  ShakeOptions shake_;
  std::vector<Event> events_;
};

// Camera looking along heading (counter-clockwise from east) and tilt below the horizon, radians, image upright.
Eigen::Quaterniond LookAlong(double heading, double tilt);

}  // namespace mapmend::simulate

#include "tools/simulate/trajectory.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/simulate/random.h"

namespace mapmend::simulate {
namespace {

constexpr double kPi = std::numbers::pi, kDegree = kPi / 180;

// The angle equal to angle that is nearest to reference.
double Near(double angle, double reference) { return angle - 2 * kPi * std::round((angle - reference) / (2 * kPi)); }

// 0 to 1 and back, smooth, with a rest at 1 over the middle third.
double Bump(double s) {
  if (s <= 0 || s >= 1) return 0;
  const double ramp = std::min({s, 1 - s, 1.0 / 3}) * 3;
  return ramp * ramp * ramp * (ramp * (ramp * 6 - 15) + 10);
}

}  // namespace

Eigen::Quaterniond LookAlong(double heading, double tilt) {
  const Eigen::Vector3d forward(std::cos(heading) * std::cos(tilt), std::sin(heading) * std::cos(tilt),
                                -std::sin(tilt));
  const Eigen::Vector3d right(std::sin(heading), -std::cos(heading), 0);
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  return Eigen::Quaterniond(rotation);
}

CameraMotion::CameraMotion(const Scenario& scenario)
    : half_width_(scenario.trajectory.smoothing / 2), shake_(scenario.shake), events_(scenario.events) {
  switch (scenario.trajectory.kind) {
    case TrajectoryOptions::Kind::kSurvey:
      BuildSurvey(scenario.trajectory);
      break;
    case TrajectoryOptions::Kind::kCircle:
      BuildCircle(scenario.trajectory);
      break;
    case TrajectoryOptions::Kind::kPath:
      BuildPath(scenario.trajectory);
      break;
  }
  for (size_t i = 1; i < keys_.size(); ++i) {
    const double dt = keys_[i].time - keys_[i - 1].time;
    for (int c = 0; c < 5; ++c) {
      const double a = keys_[i - 1].value[c], b = keys_[i].value[c];
      keys_[i].first[c] = keys_[i - 1].first[c] + dt * (a + b) / 2;
      keys_[i].second[c] = keys_[i - 1].second[c] + dt * keys_[i - 1].first[c] + dt * dt * (2 * a + b) / 6;
    }
  }
  // Dryden's spectrum of turbulence, 1 / (1 + (f / corner)^2) (MIL-F-8785C), as a sum of sinusoids; above it the
  // propellers.
  Random random(Hash(scenario.seed, 41));
  for (int channel = 0; channel < 6; ++channel) {
    const double rms = channel < 3 ? shake_.position : shake_.attitude_deg * kDegree;
    double power = 0;
    std::vector<Wave>& waves = waves_[channel];
    constexpr int kWaves = 24;
    constexpr double kLow = 0.05, kHigh = 8;
    for (int i = 0; i < kWaves; ++i) {
      const double f = kLow * std::pow(kHigh / kLow, (i + random.Uniform()) / kWaves);
      const double density = f / (1 + f * f / (shake_.corner_hz * shake_.corner_hz));  // times f: equal steps of log f
      waves.push_back({2 * kPi * f, random.Uniform(0, 2 * kPi), std::sqrt(density)});
      power += density / 2;
    }
    for (Wave& wave : waves) wave.amplitude *= rms / std::sqrt(power);
    if (channel < 3) continue;
    for (int i = 0; i < 4; ++i) {
      waves.push_back({2 * kPi * random.Uniform(20, 60), random.Uniform(0, 2 * kPi),
                       shake_.vibration_deg * kDegree * std::sqrt(0.5)});
    }
  }
}

void CameraMotion::AddKey(double seconds_later, const std::array<double, 5>& value) {
  if (keys_.empty()) {
    keys_.push_back({0, value, {}, {}});
    return;
  }
  Key key{keys_.back().time + std::max(seconds_later, 1e-6), value, {}, {}};
  key.value[3] = Near(value[3], keys_.back().value[3]);
  keys_.push_back(key);
}

void CameraMotion::BuildSurvey(const TrajectoryOptions& o) {
  const double heading = o.heading_deg * kDegree;
  const Eigen::Vector3d along(std::cos(heading), std::sin(heading), 0), left(-along.y(), along.x(), 0);
  std::vector<Waypoint> points;
  for (int strip = 0; strip < o.strips; ++strip) {
    for (const bool end : {false, true}) {
      Waypoint point;
      point.position = o.start + strip * o.spacing * left + ((strip % 2 == 1) != end ? o.strip_length : 0.0) * along;
      if (!o.turn) point.heading_deg = o.heading_deg;
      points.push_back(point);
    }
  }
  TrajectoryOptions path = o;
  path.points = points;
  BuildPath(path);
}

void CameraMotion::BuildCircle(const TrajectoryOptions& o) {
  const int steps = std::max(8, static_cast<int>(std::abs(o.turns) * 90));
  const double step = 2 * kPi * o.turns / steps;
  for (int i = 0; i <= steps; ++i) {
    const double angle = o.heading_deg * kDegree + i * step;
    const double look = o.turn ? angle + (step > 0 ? kPi / 2 : -kPi / 2) : angle + kPi;
    AddKey(o.radius * std::abs(step) / o.speed,
           {o.start.x() + o.radius * std::cos(angle), o.start.y() + o.radius * std::sin(angle), o.start.z(), look,
            o.tilt_deg * kDegree});
  }
}

void CameraMotion::BuildPath(const TrajectoryOptions& o) {
  const size_t count = o.points.size();
  const auto tilt = [&](size_t i) { return o.points[i].tilt_deg.value_or(o.tilt_deg) * kDegree; };
  // Heading of leg i, from point i to i + 1, where points do not say.
  const auto leg = [&](size_t i) {
    i = count > 1 ? std::min(i, count - 2) : 0;
    const Eigen::Vector3d d =
        count > 1 ? Eigen::Vector3d(o.points[i + 1].position - o.points[i].position) : Eigen::Vector3d::UnitX();
    return d.head<2>().norm() > 1e-6 ? std::atan2(d.y(), d.x()) : o.heading_deg * kDegree;
  };
  const auto key = [&](size_t i, double heading) {
    const Eigen::Vector3d& p = o.points[i].position;
    return std::array<double, 5>{p.x(), p.y(), p.z(), heading, tilt(i)};
  };
  for (size_t i = 0; i < count; ++i) {
    const Waypoint& point = o.points[i];
    const double arrive = point.heading_deg ? *point.heading_deg * kDegree : leg(i == 0 ? 0 : i - 1);
    const double leave = point.heading_deg ? arrive : leg(i);
    double travel = 0;
    if (i > 0) {
      const double turned = keys_.empty() ? 0 : std::abs(Near(arrive, keys_.back().value[3]) - keys_.back().value[3]);
      travel = std::max((point.position - o.points[i - 1].position).norm() / o.speed, turned / (o.turn_rate * kDegree));
    }
    AddKey(travel, key(i, arrive));
    if (point.hold > 0) AddKey(point.hold, key(i, arrive));
    const double turn = std::abs(Near(leave, arrive) - arrive);
    if (turn > 1e-9 && i + 1 < count) AddKey(turn / (o.turn_rate * kDegree), key(i, leave));
  }
}

// Of the polyline of keys, which is constant before the first and after the last.
std::array<double, 5> CameraMotion::SecondIntegral(double time) const {
  std::array<double, 5> result;
  if (time <= keys_.front().time || keys_.size() == 1) {
    const double dt = time - keys_.front().time;
    for (int c = 0; c < 5; ++c) result[c] = keys_.front().value[c] * dt * dt / 2;
    return result;
  }
  if (time >= keys_.back().time) {
    const Key& last = keys_.back();
    const double dt = time - last.time;
    for (int c = 0; c < 5; ++c) result[c] = last.second[c] + last.first[c] * dt + last.value[c] * dt * dt / 2;
    return result;
  }
  const auto next =
      std::upper_bound(keys_.begin(), keys_.end(), time, [](double t, const Key& key) { return t < key.time; });
  const Key &a = *(next - 1), &b = *next;
  const double dt = time - a.time, slope = 1 / (b.time - a.time);
  for (int c = 0; c < 5; ++c) {
    result[c] =
        a.second[c] + a.first[c] * dt + a.value[c] * dt * dt / 2 + (b.value[c] - a.value[c]) * slope * dt * dt * dt / 6;
  }
  return result;
}

std::array<double, 5> CameraMotion::Path(double time) const {
  // Mean under a triangle of half-width 2 h: twice a mean over h to either side.
  const double h = half_width_;
  const auto before = SecondIntegral(time - 2 * h), now = SecondIntegral(time), after = SecondIntegral(time + 2 * h);
  std::array<double, 5> result;
  for (int c = 0; c < 5; ++c) result[c] = (after[c] - 2 * now[c] + before[c]) / (4 * h * h);
  return result;
}

Rigid3 CameraMotion::WorldFromCamera(double time) const {
  const auto path = Path(time);
  Eigen::Vector3d position(path[0], path[1], path[2]);
  double heading = path[3], tilt = path[4];
  double shake[6];
  for (int channel = 0; channel < 6; ++channel) {
    shake[channel] = 0;
    for (const Wave& wave : waves_[channel])
      shake[channel] += wave.amplitude * std::sin(wave.frequency * time + wave.phase);
  }
  if (shake_.gait_hz > 0) {
    const double step = 2 * kPi * shake_.gait_hz * time;
    shake[2] += shake_.gait * std::sin(step);
    shake[0] += 0.5 * shake_.gait * std::sin(step / 2) * -std::sin(heading);
    shake[1] += 0.5 * shake_.gait * std::sin(step / 2) * std::cos(heading);
  }
  Eigen::Vector3d turn(shake[3], shake[4], shake[5]);
  for (const Event& event : events_) {
    const double bump = Bump((time - event.at) / event.duration);
    if (bump == 0) continue;
    if (event.kind == Event::Kind::kGust) turn += event.amount * kDegree * bump * Eigen::Vector3d(0.45, -0.35, 0.82);
    if (event.kind == Event::Kind::kWhipPan) heading += event.amount * kDegree * bump;
    if (event.kind == Event::Kind::kDrop) position.z() -= event.amount * bump;
  }
  position += Eigen::Vector3d(shake[0], shake[1], shake[2]);
  const double angle = turn.norm();
  const Eigen::Quaterniond offset =
      angle > 1e-12 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) : Eigen::Quaterniond::Identity();
  return {LookAlong(heading, tilt) * offset, position};
}

}  // namespace mapmend::simulate

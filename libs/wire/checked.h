#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/geometry/similarity3.h"
#include "libs/stream/ids.h"

// What the codecs of this library share; nobody else includes it. Bytes from the bus may come from anybody.
namespace mapmend::wire {

// Says why a message is not believed. Thrown and caught within a codec.
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline void Require(bool condition, const char* what) {
  if (!condition) throw Refused(what);
}

template <typename T>
bool AllFinite(const T* values, size_t n) {
  return std::all_of(values, values + n, [](T v) { return std::isfinite(v); });
}

template <typename T>
bool AllFinite(const std::vector<T>& values) {
  return AllFinite(values.data(), values.size());
}

inline double SquaredNorm(const double* xyzw) {
  double sum = 0;
  for (int i = 0; i < 4; ++i) sum += xyzw[i] * xyzw[i];
  return sum;
}

// Whether the squared norm of x y z w is one up to the tolerance; not if any of them is not finite.
inline bool IsRotation(const double* xyzw, double tolerance) { return std::abs(SquaredNorm(xyzw) - 1) < tolerance; }

// A rotation that is a unit quaternion up to rounding stays as it is: to normalise it would change last bits, and what
// is read and sent on must stay the same.
inline Eigen::Quaterniond ReadRotation(const double* xyzw) {
  const Eigen::Quaterniond rotation(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  return std::abs(SquaredNorm(xyzw) - 1) > 1e-12 ? rotation.normalized() : rotation;
}

// tx ty tz qx qy qz qw, as ToArray writes them.
inline Rigid3 ReadRigid(const double* values) {
  Rigid3 pose;
  pose.rotation = ReadRotation(values + 3);
  pose.translation = Eigen::Vector3d(values[0], values[1], values[2]);
  return pose;
}

// The same, and a scale.
inline Similarity3 ReadSimilarity(const double* values) {
  Similarity3 transform(ReadRigid(values));
  transform.scale = values[7];
  return transform;
}

template <typename T>
int32_t Count(const std::vector<T>& values) {
  return static_cast<int32_t>(values.size());
}

// Decodes a message made by lcm-gen and reads it by `read`, which throws Refused for what cannot be.
template <typename Value, typename Message>
Decoded<Value> DecodeChecked(const uint8_t* data, int size, Value (*read)(const Message&)) {
  const Decoded<Message> message = Decode<Message>(data, size);
  if (!message.value) return {std::nullopt, message.error};
  try {
    return {read(*message.value), ""};
  } catch (const Refused& e) {
    return {std::nullopt, std::string(Message::getTypeName()) + ": " + e.what()};
  }
}

}  // namespace mapmend::wire

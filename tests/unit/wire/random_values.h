#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/geometry/similarity3.h"
#include "libs/stream/ids.h"
#include "libs/stream/stream_cursor.h"

namespace mapmend {

// Values of all kinds for the tests that what is encoded comes back.
class RandomValues {
 public:
  explicit RandomValues(unsigned seed) : random_(seed) {}

  int Int(int first, int last) { return std::uniform_int_distribution<int>(first, last)(random_); }
  int64_t Seq() { return std::uniform_int_distribution<int64_t>(-1, int64_t{1} << 60)(random_); }
  bool Bool() { return Int(0, 1) == 1; }
  double Real() { return std::uniform_real_distribution<double>(-1e3, 1e3)(random_); }
  double Positive() { return std::exp(std::uniform_real_distribution<double>(-9, 9)(random_)); }
  float Float() { return static_cast<float>(Real()); }
  std::string Text() {
    std::string text;
    for (int i = Int(0, 40); i > 0; --i) text += static_cast<char>(Int(1, 127));
    return text;
  }
  std::string Session() {
    std::string text;
    for (int i = Int(1, 64); i > 0; --i) text += "0123456789abcdefABCDEF-_"[Int(0, 23)];
    return text;
  }
  SubmapKey Key() { return {Session(), SubmapId(Int(0, 1 << 30))}; }
  StreamCursor Cursor() { return {Session(), Seq()}; }
  Rigid3 Pose() {
    const Eigen::Quaterniond q(Real(), Real(), Real(), Real());
    return {q, {Real(), Real(), Real()}};
  }
  Similarity3 Similarity() {
    Similarity3 transform(Pose());
    transform.scale = Positive();
    return transform;
  }
  std::vector<uint8_t> Bytes() {
    return List<uint8_t>(200, [this] { return static_cast<uint8_t>(Int(0, 255)); });
  }
  // Up to `most` values.
  template <typename Value, typename Make>
  std::vector<Value> List(int most, Make make) {
    std::vector<Value> values;
    for (int i = Int(0, most); i > 0; --i) values.push_back(make());
    return values;
  }

 private:
  std::mt19937 random_;
};

// Decode(Encode(x)) == x, and to the last bit.
template <typename Value>
void ExpectBack(const Value& value) {
  const std::vector<uint8_t> data = Encode(value);
  const Decoded<Value> decoded = Decode<Value>(data);
  ASSERT_TRUE(decoded.value) << decoded.error;
  EXPECT_TRUE(*decoded.value == value);
  EXPECT_EQ(Encode(*decoded.value), data);
}

}  // namespace mapmend

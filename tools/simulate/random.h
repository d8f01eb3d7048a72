#pragma once

#include <cmath>
#include <cstdint>

// Randomness as pure functions of a seed and of coordinates, so that every frame and every texel can be computed alone
// and in any order. Only integer and IEEE arithmetic: the same bits on every machine.
namespace mapmend::simulate {

// SplitMix64's finaliser (Steele, Lea, Flood, OOPSLA 2014).
inline uint64_t Hash(uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}
inline uint64_t Hash(uint64_t a, uint64_t b) { return Hash(Hash(a) ^ b); }
inline uint64_t Hash(uint64_t a, uint64_t b, uint64_t c) { return Hash(Hash(a, b) ^ c); }

// [0, 1) from the upper bits of a hash.
inline double Unit(uint64_t hash) { return static_cast<double>(hash >> 11) * 0x1.0p-53; }

// A stream of numbers.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(Hash(seed)) {}
  uint64_t Next() { return Hash(state_++); }
  double Uniform() { return Unit(Next()); }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  int Int(int count) { return static_cast<int>(Uniform() * count); }  // 0 .. count - 1
  // Standard normal but for the tails: the sum of twelve uniform numbers.
  double Gaussian() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += Uniform();
    return sum;
  }

 private:
  uint64_t state_;
};

// Smooth noise in [-1, 1] with one random value per unit cell corner. A small hash of its own: it is called for every
// texel.
inline double ValueNoise(double x, double y, uint64_t seed) {
  const double fx = std::floor(x), fy = std::floor(y);
  const auto base = static_cast<uint32_t>(static_cast<int64_t>(fx)) * 0x8da6b343u +
                    static_cast<uint32_t>(static_cast<int64_t>(fy)) * 0xd8163841u +
                    static_cast<uint32_t>(seed ^ seed >> 32);
  const auto value = [](uint32_t h) {
    h = (h ^ h >> 16) * 0x7feb352du;
    h = (h ^ h >> 15) * 0x846ca68bu;
    return static_cast<double>(static_cast<int32_t>(h)) * 0x1.0p-31;
  };
  double u = x - fx, v = y - fy;
  u = u * u * u * (u * (u * 6 - 15) + 10);
  v = v * v * v * (v * (v * 6 - 15) + 10);
  const double a = value(base), b = value(base + 0x8da6b343u), c = value(base + 0xd8163841u),
               d = value(base + 0x8da6b343u + 0xd8163841u);
  return (a + (b - a) * u) * (1 - v) + (c + (d - c) * u) * v;
}

// Octaves of ValueNoise, each at twice the frequency and gain times the height. About [-1, 1].
inline double Fbm(double x, double y, int octaves, double gain, uint64_t seed) {
  double sum = 0, amplitude = 1, total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * ValueNoise(x, y, seed + static_cast<uint64_t>(i) * 0x9e3779b97f4a7c15ULL);
    total += amplitude;
    amplitude *= gain;
    x = 2 * x + 17.3;
    y = 2 * y - 9.1;
  }
  return sum / total;
}

}  // namespace mapmend::simulate

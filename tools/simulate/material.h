#pragma once

#include <array>
#include <string>

#include "tools/simulate/random.h"
#include "tools/simulate/texture.h"

namespace mapmend::simulate {

// A texture without end and without repetition made from a small photograph: on a triangular lattice every corner has
// its own random window of the photograph, and between the corners the three are blended so that mean and variance stay
// those of the photograph (Heitz and Neyret, High-Performance By-Example Noise using a Histogram-Preserving Blending
// Operator, HPG 2018; here without the histogram transform). Any point can be evaluated alone.
class Material {
 public:
  // Removes shading wider than a third of the photograph first, so that windows fit each other.
  explicit Material(const Image& photograph);

  // x, y in texels of the photograph. seed tells places apart that must not look alike.
  Color At(double x, double y, uint64_t seed) const;
  const Color& Mean() const { return mean_; }

 private:
  int width_, height_;
  double edge_;  // of the lattice, texels
  Color mean_;
  std::vector<Color> difference_;  // photograph minus mean
};

// The photographs of data/simulator, read once per program run.
struct MaterialLibrary {
  Material lawn, dry_lawn, meadow, marsh, bush, crown;
  Image photos;  // twelve small aerial photographs, 4 x 3, 320 x 240 each

  // Throws std::runtime_error naming the file that is missing.
  explicit MaterialLibrary(const std::string& folder);
};

// Procedural surfaces, [0, 255]; x, y in metres.
Color Asphalt(double x, double y, uint64_t seed);
Color Concrete(double x, double y, uint64_t seed);
Color Shingles(double x, double y, const Color& base, uint64_t seed);
Color Bricks(double x, double y, const Color& base, uint64_t seed);
Color Wood(double x, double y, const Color& base, uint64_t seed);
Color Carpet(double x, double y, const Color& base, uint64_t seed);

}  // namespace mapmend::simulate

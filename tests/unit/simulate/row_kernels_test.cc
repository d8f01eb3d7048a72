#include "tools/simulate/row_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "tools/simulate/random.h"

namespace mapmend::simulate {
namespace row_kernels_test {

const RowKernels* const kKernels[] = {&RowKernels::Portable(), &RowKernels::Get()};

HeightGrid RoughGrid() {
  HeightGrid grid;
  grid.x0 = grid.y0 = -30;
  grid.spacing = 0.5;
  grid.width = grid.height = 121;
  for (int j = 0; j < 121; ++j) {
    for (int i = 0; i < 121; ++i) grid.z.push_back(static_cast<float>(6 * Fbm(i / 4.0, j / 4.0, 3, 0.5, 5)));
  }
  return grid;
}

// Eight rays from 40 m above that are near each other.
void Aim(Random* random, Eigen::Vector3d* origins, Eigen::Vector3d* directions) {
  const Eigen::Vector3d origin(random->Uniform(-20, 20), random->Uniform(-20, 20), 40);
  const Eigen::Vector3d middle(random->Uniform(-0.6, 0.6), random->Uniform(-0.6, 0.6), -1);
  for (int k = 0; k < 8; ++k) {
    origins[k] = origin;
    const Eigen::Vector3d off(k % 2 == 0 ? 0 : 0.02, k % 4 < 2 ? 0 : 0.02, 0);
    directions[k] = (middle + off * (k < 4 ? 1 : 0.5)).normalized();
  }
}

TEST(RowKernels, RaysOfABeamMeetWhatEachAloneMeets) {
  Scene scene;
  scene.grid = RoughGrid();
  for (int k = 0; k < 6; ++k) scene.solids.push_back(MakeBox({-20.0 + 8 * k, 15.0 - 7 * k, 4}, {3, 4, 10}, 0.3 * k));
  scene.Build();
  Random random(3);
  int cast = 0, grounds = 0, others = 0;
  for (int round = 0; round < 3000; ++round) {
    Eigen::Vector3d origins[8], directions[8];
    Aim(&random, origins, directions);
    // The first four are the corners of the beam.
    const Beam beam = scene.ClearBeam(origins, directions);
    if (beam.height > 1e29) continue;
    Hit hits[8];
    scene.CastEight(origins, directions, 8, beam, hits);
    for (int k = 0; k < 8; ++k) {
      const Hit alone = scene.Cast(origins[k], directions[k]);
      ++cast;
      if (std::abs(alone.distance - hits[k].distance) > 1e-3 || alone.surface != hits[k].surface) ++others;
      grounds += hits[k].surface == Hit::kGround;
    }
  }
  EXPECT_GT(cast, 10000);
  EXPECT_GT(grounds, cast / 2);
  EXPECT_LT(grounds, cast);
  // Rays that graze an edge.
  EXPECT_LE(others, cast / 2000);
}

TEST(RowKernels, RaysAreTheSameOnAllProcessors) {
  const HeightGrid grid = RoughGrid();
  BigVector<float> max;
  for (int j = 0; j < 120; ++j) {
    for (int i = 0; i < 120; ++i)
      max.push_back(std::max({grid.At(i, j), grid.At(i + 1, j), grid.At(i, j + 1), grid.At(i + 1, j + 1)}));
  }
  for (const bool solids : {false, true}) {
    // Either no block has solids or every one.
    std::vector<uint32_t> begin(15 * 15 + 1, 0);
    for (size_t k = 0; solids && k < begin.size(); ++k) begin[k] = static_cast<uint32_t>(k);
    const HeightCells cells{&grid, max.data(), begin.data(), 120, 120, 3, 15};
    Random random(8);
    int found_all = 0;
    for (int round = 0; round < 500; ++round) {
      SteepRays rays{
          static_cast<int>(random.Uniform(0, 110)), static_cast<int>(random.Uniform(0, 110)), {}, {}, {}, {}, {}, {}};
      for (int k = 0; k < 8; ++k) {
        rays.x[k] = static_cast<float>(random.Uniform(0, 4)), rays.y[k] = static_cast<float>(random.Uniform(0, 4));
        rays.z[k] = 7;
        rays.dx[k] = static_cast<float>(random.Uniform(-1.4, 1.4));
        rays.dy[k] = k == 3 ? 0 : static_cast<float>(random.Uniform(-1.4, 1.4));
        rays.dz[k] = -0.8f;
      }
      const unsigned lanes = round % 5 == 0 ? 0x5b : 0xff;
      float distance[2][8], slope[2][8];
      unsigned found[2];
      for (const int which : {0, 1})
        found[which] = kKernels[which]->cast_down(cells, rays, lanes, distance[which], slope[which]);
      ASSERT_EQ(found[0], found[1]);
      EXPECT_EQ(std::memcmp(distance[0], distance[1], sizeof distance[0]), 0);
      EXPECT_EQ(std::memcmp(slope[0], slope[1], sizeof slope[0]), 0);
      EXPECT_EQ(found[0] & ~lanes, 0u);
      for (int k = 0; k < 8; ++k) {
        if ((found[0] >> k & 1) == 0) continue;
        ++found_all;
        const double d = distance[0][k], x = -30 + 0.5 * (rays.i + rays.x[k] + d * rays.dx[k]),
                     y = -30 + 0.5 * (rays.j + rays.y[k] + d * rays.dy[k]);
        EXPECT_NEAR(rays.z[k] + d * rays.dz[k], grid.Height(x, y), 1e-3);
      }
    }
    // Where each block may hold a solid, rays that come to another one are left to others.
    EXPECT_GT(found_all, solids ? 200 : 3000);
    if (solids) {
      EXPECT_LT(found_all, 2500);
    }
  }
}

TEST(RowKernels, CornersMoveAsTheCameraProjectsThem) {
  Camera camera;
  camera.width = 640, camera.height = 480;
  camera.fx = 500, camera.fy = 510, camera.cx = 320, camera.cy = 240;
  camera.distortion = {-0.06, 0.012, 4e-4, -3e-4, 0.001};
  for (const bool distorted : {false, true}) {
    if (!distorted) camera.distortion = {};
    const Rigid3 moves[] = {
        {Eigen::Quaterniond(1, 0.004, -0.002, 0.003), {0.05, -0.02, 0.1}},
        {Eigen::Quaterniond(1, -0.004, 0.003, -0.002), {-0.04, 0.03, -0.1}},
    };
    CornerMotion motion;
    for (int half = 0; half < 2; ++half) {
      const Eigen::Matrix3d rotation = moves[half].rotation.toRotationMatrix();
      auto& to = half == 0 ? motion.begin : motion.end;
      for (int lane = 0; lane < 8; ++lane) {
        for (int i = 0; i < 9; ++i) to[i][lane] = static_cast<float>(rotation(i / 3, i % 3));
        for (int i = 0; i < 3; ++i) to[9 + i][lane] = static_cast<float>(moves[half].translation[i]);
      }
    }
    const Lens lens{500, 510, 320, 240, {-0.06f, 0.012f, 4e-4f, -3e-4f, 0.001f}, distorted};
    Random random(2);
    CornerPoints points;
    for (int k = 0; k < 8; ++k) {
      points.x[k] = static_cast<float>(random.Uniform(-0.5, 0.5));
      points.y[k] = static_cast<float>(random.Uniform(-0.4, 0.4));
      points.z[k] = 0.8f;
      points.distance[k] = static_cast<float>(random.Uniform(3, 60));
      points.pixel_x[k] = 10.f * static_cast<float>(k), points.pixel_y[k] = 200;
    }
    Color moved[2][8];
    for (const int which : {0, 1}) kKernels[which]->move_corners(motion, lens, points, moved[which]);
    EXPECT_EQ(std::memcmp(moved[0], moved[1], sizeof moved[0]), 0);
    if (distorted) camera.distortion = {-0.06, 0.012, 4e-4, -3e-4, 0.001};
    for (int k = 0; k < 8; ++k) {
      const Eigen::Vector3d point = Eigen::Vector3d(points.x[k], points.y[k], points.z[k]) * points.distance[k];
      for (int half = 0; half < 2; ++half) {
        const Eigen::Vector2d pixel = camera.Project(moves[half] * point);
        EXPECT_NEAR(moved[0][k][2 * half], pixel.x() - points.pixel_x[k], 1e-3);
        EXPECT_NEAR(moved[0][k][2 * half + 1], pixel.y() - points.pixel_y[k], 1e-3);
      }
    }
  }
}

TEST(RowKernels, ValuesAreTheSameOnAllProcessors) {
  Random random(9);
  for (const int width : {37, 64}) {
    std::vector<Color> lines[3];
    for (auto& line : lines) {
      for (int x = 0; x < width; ++x)
        line.push_back(Rgb(random.Uniform(0, 70000), random.Uniform(0, 60000), random.Uniform(0, 50000)));
    }
    const Exposure exposure{Rgb(1.1, 1, 0.9), Rgb(900, 800, 700), 0.9f, 1e-4f};
    std::vector<Color> noises(RowKernels::kNoises);
    for (Color& noise : noises) noise = Rgb(random.Gaussian(), random.Gaussian(), random.Gaussian());
    std::vector<Color> exposed[2][3], sharp[2];
    std::vector<uint8_t> bytes[2], quiet[2];
    for (const int which : {0, 1}) {
      const RowKernels& kernels = *kKernels[which];
      const Color* rows[3];
      for (int k = 0; k < 3; ++k) {
        exposed[which][k] = lines[k];
        kernels.expose(exposure, -20, 5, width, exposed[which][k].data());
        rows[k] = exposed[which][k].data();
      }
      std::vector<Color> sums(width + 2);
      sharp[which].resize(width);
      kernels.sharpen(rows, width, 0.25f, sums.data(), sharp[which].data());
      bytes[which].resize(3 * width), quiet[which].resize(3 * width);
      kernels.store(sharp[which].data(), width, noises.data(), 1.5f, 11, bytes[which].data());
      kernels.store(sharp[which].data(), width, noises.data(), 0, 11, quiet[which].data());
    }
    for (int x = 0; x < width; ++x) {
      EXPECT_EQ(std::memcmp(&exposed[0][1][x], &exposed[1][1][x], sizeof(Color)), 0) << x;
      EXPECT_EQ(std::memcmp(&sharp[0][x], &sharp[1][x], sizeof(Color)), 0) << x;
      const float dx = static_cast<float>(x) - 20;
      EXPECT_NEAR(exposed[0][1][x][0], std::sqrt((0.9 * lines[1][x][0] + 900) * 1.1 * (1 - 1e-4 * (dx * dx + 25))),
                  0.01);
      double mean = 0;
      for (int k = 0; k < 3; ++k) {
        for (int d = -1; d <= 1; ++d) mean += exposed[0][k][std::clamp(x + d, 0, width - 1)][1] / 9;
      }
      EXPECT_NEAR(sharp[0][x][1], exposed[0][1][x][1] + 0.25 * (exposed[0][1][x][1] - mean), 0.01);
      EXPECT_NEAR(quiet[0][3 * x + 2], std::clamp(sharp[0][x][0], 0.f, 255.f), 0.51);
      EXPECT_NEAR(quiet[0][3 * x], std::clamp(sharp[0][x][2], 0.f, 255.f), 0.51);
    }
    EXPECT_EQ(bytes[0], bytes[1]);
    EXPECT_EQ(quiet[0], quiet[1]);
    EXPECT_NE(bytes[0], quiet[0]);
  }
}

}  // namespace row_kernels_test
}  // namespace mapmend::simulate

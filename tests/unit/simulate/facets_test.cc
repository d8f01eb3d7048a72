#include "tools/simulate/facets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tools/simulate/random.h"
#include "tools/simulate/renderer.h"

namespace mapmend::simulate {
namespace facets_test {

// A yard with boxes and houses of one textured and several plain faces.
void FillYard(Scene* scene) {
  HeightGrid& grid = scene->grid;
  grid.x0 = grid.y0 = -20;
  grid.spacing = 1;
  grid.width = grid.height = 41;
  grid.z.assign(41 * 41, 0.f);
  Image picture(256, 256);
  Random random(3);
  for (uint32_t& texel : picture.texels) texel = Pack(Rgb(random.Uniform(40, 200), random.Uniform(40, 200), 90));
  scene->ground = std::make_shared<Texture>(picture);
  scene->ground_texels_per_metre = 6;
  scene->textures.push_back(std::make_shared<Texture>(picture));
  for (int k = 0; k < 40; ++k) {
    const double height = random.Uniform(0.3, 4), radius = random.Uniform(4, 18), angle = random.Uniform(0, 6.28);
    const Eigen::Vector3d center(radius * std::cos(angle), radius * std::sin(angle), height / 2);
    const Eigen::Vector3d size(random.Uniform(0.2, 3), random.Uniform(0.2, 3), height);
    Solid solid =
        k % 3 == 0 ? MakeHouse(center, size, random.Uniform(0, 3), 0.8) : MakeBox(center, size, random.Uniform(0, 3));
    for (Face& face : solid.faces) face.color = Rgb(200, 150, 100);
    LayTexture(&solid.faces[0], 0, center, Eigen::Vector3d::UnitY(), -Eigen::Vector3d::UnitZ(), 40);
    solid.faces[0].color = Color{1, 1, 1, 1};
    scene->solids.push_back(solid);
  }
  scene->Build();
}

Rigid3 Walk(double time) {
  const Eigen::Quaterniond level(Eigen::AngleAxisd(-1.45, Eigen::Vector3d::UnitX()));
  return {Eigen::Quaterniond(Eigen::AngleAxisd(3 * time, Eigen::Vector3d::UnitZ())) * level,
          Eigen::Vector3d(1.5 * time, 0.4, 1.7)};
}

Camera YardCamera() {
  Camera camera;
  camera.width = 230;  // not whole tiles
  camera.height = 148;
  camera.fx = camera.fy = 140;
  camera.cx = 117.3, camera.cy = 70.2;
  camera.distortion[0] = -0.06;
  return camera;
}

TEST(Facets, PixelsMeetWhatRaysMeet) {
  Scene scene;
  FillYard(&scene);
  const Camera camera = YardCamera();
  for (const double readout : {0.0, 0.03}) {
    RenderOptions options;
    options.readout = readout;
    Renderer renderer(&scene, camera, options);
    Frame frame;
    int pixels = 0, different = 0, solid = 0, sky = 0;
    for (const double time : {0.0, 0.7, 1.4}) {
      renderer.Render(Walk, time, {}, &frame);
      for (int y = 0; y < camera.height; ++y) {
        const Rigid3 pose = Walk(time + (static_cast<double>(y) / (camera.height - 1) - 0.5) * readout);
        for (int x = 0; x < camera.width; ++x, ++pixels) {
          const Hit hit = scene.Cast(pose.translation, pose.rotation * renderer.Ray(x, y));
          const double distance = renderer.Distances()[static_cast<size_t>(y) * camera.width + x];
          solid += hit.surface > Hit::kGround;
          sky += hit.surface == Hit::kNothing;
          // A ray that grazes an edge may fall on either side.
          if (hit.surface == Hit::kNothing ? !std::isinf(distance)
                                           : !(std::abs(distance - hit.distance) < 1e-3 * hit.distance))
            ++different;
        }
      }
    }
    EXPECT_GT(solid, pixels / 5);
    EXPECT_GT(sky, pixels / 50);
    EXPECT_LT(different, pixels / 5000) << "readout " << readout;
  }
}

// The two sets of loops give the same bits.
TEST(RowKernels, AreTheSameOnAllProcessors) {
  Scene scene;
  FillYard(&scene);
  constexpr int kCount = 8;
  const RowKernels* kernels[] = {&RowKernels::Portable(), &RowKernels::Get()};
  std::vector<uint16_t> all;
  int drawn = 0;
  for (int k = 0; k < 200; ++k) {
    const double time = 0.02 * k;
    FacetRow facets;
    facets.Prepare(scene, Walk(time), Walk(time + 0.001), 7, {-0.2f, -0.4f, 0.2f, 0.4f}, 1e-3f);
    all.resize(facets.Solids().size());
    for (size_t s = 0; s < all.size(); ++s) all[s] = static_cast<uint16_t>(s);
    float x[kCount], y[kCount], stretch[kCount];
    for (int i = 0; i < kCount; ++i) {
      x[i] = -0.2f + 0.05f * static_cast<float>(i), y[i] = 0.004f * static_cast<float>(k % 100) - 0.2f;
      stretch[i] = std::sqrt(1 + x[i] * x[i] + y[i] * y[i]);
    }
    float distance[2][kCount] = {};
    int surface[2][kCount] = {};
    Light light[2][kCount] = {};
    for (int which = 0; which < 2; ++which) {
      kernels[which]->draw_facets(facets, all.data(), static_cast<int>(all.size()),
                                  {x, y, stretch, distance[which], surface[which], light[which], kCount, 3});
    }
    EXPECT_EQ(std::memcmp(distance[0], distance[1], sizeof distance[0]), 0);
    EXPECT_EQ(std::memcmp(surface[0], surface[1], sizeof surface[0]), 0);
    EXPECT_EQ(std::memcmp(light[0], light[1], sizeof light[0]), 0);
    for (const int s : surface[0]) drawn += s >= Hit::kGround;
  }
  EXPECT_GT(drawn, 400);

  constexpr int kWidth = 64, kHeight = 48;
  BigVector<Light> picture(kWidth * kHeight);
  Random random(5);
  for (Light& pixel : picture) pixel = PackLight(Rgb(random.Uniform(0, 255), random.Uniform(0, 255), 30));
  float distances[kCount];
  for (int i = 0; i < kCount; ++i) distances[i] = 20.f + static_cast<float>(i);
  for (int k = 0; k < 100; ++k) {
    const auto draw = [&] { return static_cast<float>(random.Uniform(-6, 6)); };
    const Color offset = {draw(), draw(), draw(), draw()};
    const RowMotion motion{offset, Color{} + 0.02f, Color{} + 1.5f, Color{}};
    Color blurred[2][kCount], even[2][kCount];
    for (int which = 0; which < 2; ++which) {
      kernels[which]->blur(picture.data(), kWidth, kHeight, 24, 20, kCount, distances, motion, blurred[which]);
      kernels[which]->blur_even(picture.data(), kWidth, 24, 20, offset, even[which]);
    }
    EXPECT_EQ(std::memcmp(blurred[0], blurred[1], sizeof even[0]), 0);
    EXPECT_EQ(std::memcmp(even[0], even[1], sizeof even[0]), 0);
    // Where all move alike the two blurs are one to rounding.
    kernels[1]->blur(picture.data(), kWidth, kHeight, 24, 20, kCount, distances, {offset, Color{}, Color{}, Color{}},
                     blurred[0]);
    for (int i = 0; i < kCount; ++i) {
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(blurred[0][i][c], even[0][i][c], 12) << "of 65025";
    }
  }
}

TEST(RowKernels, EvenGroundIsTheSameOnAllProcessors) {
  constexpr int kSize = 64;
  std::vector<uint32_t> fine(kSize * kSize), coarse(kSize * kSize);
  std::vector<float> cells(kSize * kSize);
  Random random(8);
  for (auto* level : {&fine, &coarse}) {
    for (uint32_t& texel : *level) texel = static_cast<uint32_t>(random.Next());
  }
  for (float& cell : cells) cell = static_cast<float>(random.Uniform(-1e-3, 1e-3));
  PlainLook look{{{fine.data(), kSize, 1, 9.3f, 8.1f}, {coarse.data(), kSize, 0.5f, 4.4f, 4.2f}},
                 false,
                 false,
                 12000,
                 {{cells.data(), kSize, 1, 7.2f, 6.4f}, {cells.data(), kSize, 1, 5.7f, 9.1f}},
                 Color{1, 0.8f, 1.1f, 1},
                 0};
  const float stretch[8] = {1, 1.1f, 1.2f, 1.3f, 1.4f, 1.5f, 1.6f, 1.7f};
  const PlainRow row{0.4f, 0.011f, 0.1f, 0.009f, 0.01f, 1e-5f};
  for (const bool two : {false, true}) {
    for (const bool grows : {false, true}) {
      for (const int count : {8, 5}) {
        look.two = two, look.grows = grows;
        float distance[2][8] = {};
        int surface[2][8] = {};
        Light light[2][8] = {};
        for (const int which : {0, 1}) {
          const RowKernels& kernels = which == 0 ? RowKernels::Portable() : RowKernels::Get();
          kernels.paint_plain(look, row, 8,
                              {stretch, stretch, stretch, distance[which], surface[which], light[which], count, 0});
        }
        EXPECT_EQ(std::memcmp(distance[0], distance[1], sizeof distance[0]), 0);
        EXPECT_EQ(std::memcmp(light[0], light[1], sizeof light[0]), 0);
        EXPECT_NE(light[0][count - 1][1], 0);
        EXPECT_EQ(distance[0][7] != 0, count == 8);
      }
    }
  }
}

TEST(RowKernels, DetailIsTheSameOnAllProcessorsAndThatOfSinglePixels) {
  Scene scene;
  Random random(8);
  Image plain(256, 256), grey(64, 64);
  for (uint32_t& texel : plain.texels) texel = Pack(Color{100, 120, 90, 0});
  for (uint32_t& texel : grey.texels) texel = Pack(Color{} + static_cast<float>(random.Uniform(60, 196)));
  scene.ground = std::make_shared<Texture>(plain);
  scene.detail = std::make_shared<Texture>(grey);
  scene.ground_detail = 0.5f;
  const Texture& ground = *scene.ground;
  // A camera 2.5 m above texel (40, 50), that looks straight down and sees a tenth of a texel with a pixel.
  constexpr double kHeight = 2.5, kAngle = 0.04;
  constexpr float kTexels = 1;
  PlainLook look{};
  look.levels[0] = {ground.Level(0).texels.data(), 256, 1, 40, 50};
  look.tint = Color{1, 1, 1, 1};
  const PlainRow row{3 / 2.5f, 0.04f, 2 / 2.5f, 0.01f, 1 / 2.5f, 0};
  const float stretch[8] = {1, 1, 1, 1, 1, 1, 1, 1};
  float distance[2][8] = {};
  int surface[2][8] = {};
  Light light[2][8] = {};
  for (const int count : {8, 5}) {
    for (const int which : {0, 1}) {
      const RowKernels& kernels = which == 0 ? RowKernels::Portable() : RowKernels::Get();
      const PixelRow pixels{stretch, stretch, stretch, distance[which], surface[which], light[which], count, 0};
      kernels.paint_plain(look, row, 0, pixels);
      kernels.add_detail(scene.Detail(40, 50), static_cast<float>(kAngle) * kTexels, row, 0, pixels);
    }
    EXPECT_EQ(std::memcmp(light[0], light[1], sizeof light[0]), 0);
  }
  double least = 1e9, greatest = 0;
  for (int k = 0; k < 8; ++k) {
    const double u = 40 + (row.u + k * row.du) * kHeight, v = 50 + (row.v + k * row.dv) * kHeight;
    const Color expected = scene.ShadeGround({u + 0.5, v + 0.5, 0}, {0, 0, -1}, kHeight * kAngle, 0, 0);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(std::sqrt(static_cast<double>(light[0][k][c])), static_cast<double>(expected[c]), 1.5) << k;
    }
    least = std::min(least, static_cast<double>(expected[1])),
    greatest = std::max(greatest, static_cast<double>(expected[1]));
  }
  EXPECT_GT(greatest - least, 10);
}

TEST(RowKernels, GroundAtASlantIsTheSameOnAllProcessorsAndThatOfSinglePixels) {
  Scene scene;
  Random random(9);
  Image picture(1024, 1024);
  for (uint32_t& texel : picture.texels) texel = Pack(Color{} + static_cast<float>(random.Uniform(20, 230)));
  scene.ground = std::make_shared<Texture>(picture);
  const Texture& ground = *scene.ground;
  constexpr float kHeight = 40, kAngle = 0.05f;
  const GroundLook look{&ground, ground.LastWhole(), 1, -0.5f, -0.5f, kAngle, 0, 0, CanopyLevels(1), {0, 0, 0}, {}};
  for (const double tilt_deg : {70.0, 45.0, 30.0}) {  // 90 is straight down
    const auto down = static_cast<float>(std::sin(tilt_deg * M_PI / 180)),
               ahead = static_cast<float>(std::cos(tilt_deg * M_PI / 180));
    // Right is east; the picture's down is that of the ground before the camera.
    const WorldRow world{{500, 400, kHeight}, Color{1, 0, 0, 0}, Color{0, -down, ahead, 0}, Color{0, -ahead, -down, 0}};
    float x[8], y[8], stretch[8], distance[8];
    const float level[8] = {};
    int surface[8] = {};
    for (int i = 0; i < 8; ++i) {
      x[i] = 0.05f * static_cast<float>(i) - 0.2f, y[i] = 0.03f;
      stretch[i] = std::sqrt(1 + x[i] * x[i] + y[i] * y[i]);
      distance[i] = kHeight / (ahead * y[i] + down) * stretch[i];
    }
    Light light[2][8] = {};
    for (const int which : {0, 1}) {
      const RowKernels& kernels = which == 0 ? RowKernels::Portable() : RowKernels::Get();
      kernels.shade_ground(look, world, level, 255, {x, y, stretch, distance, surface, light[which], 8, 0});
    }
    EXPECT_EQ(std::memcmp(light[0], light[1], sizeof light[0]), 0);
    for (int i = 0; i < 8; ++i) {
      const double s = 1 / static_cast<double>(stretch[i]);
      const Eigen::Vector3d direction(x[i] * s, (ahead - down * y[i]) * s, -(ahead * y[i] + down) * s);
      const double d = static_cast<double>(distance[i]);
      const Color expected = scene.ShadeGround(Eigen::Vector3d(500, 400, static_cast<double>(kHeight)) + d * direction,
                                               direction, d * static_cast<double>(kAngle), 0, 0);
      EXPECT_NEAR(std::sqrt(static_cast<double>(light[0][i][1])), static_cast<double>(expected[1]), 2) << tilt_deg;
    }
  }
}

TEST(RowKernels, GroundIsTheSameOnAllProcessors) {
  HeightGrid grid;
  grid.x0 = grid.y0 = -30;
  grid.spacing = 0.5;
  grid.width = grid.height = 121;
  for (int j = 0; j < 121; ++j) {
    for (int i = 0; i < 121; ++i) grid.z.push_back(static_cast<float>(2 * Fbm(i / 15.0, j / 15.0, 3, 0.5, 5)));
  }
  Image picture(512, 512);
  Random random(4);
  for (uint32_t& texel : picture.texels) texel = Pack(Color{90, static_cast<float>(random.Uniform(40, 200)), 60, 200});
  const Texture texture(picture);
  const GroundLook look{&texture, texture.LastWhole(), 8,           240, 240, 8e-3f, 0.5f / 255,
                        0,        CanopyLevels(-0.4f), {40, 90, 7}, {}};
  const WorldRow world{{1, 2, 80}, Color{1, 0, 0, 0}, Color{0, -1, 0, 0}, Color{0.02f, 0.01f, -1, 0}};
  float x[8], y[8], stretch[8], inverse[8];
  int settled = 0;
  for (int k = 0; k < 100; ++k) {
    for (int i = 0; i < 8; ++i) {
      x[i] = 0.002f * static_cast<float>(i + k) - 0.1f, y[i] = 0.002f * static_cast<float>(k) - 0.1f;
      stretch[i] = std::sqrt(1 + x[i] * x[i] + y[i] * y[i]);
      inverse[i] = 1 / (80 + static_cast<float>(random.Uniform(-1, 1)));
    }
    float distance[2][8] = {}, slope[2][8] = {};
    int surface[2][8] = {};
    Light light[2][8] = {};
    unsigned missed[2];
    for (const int which : {0, 1}) {
      const RowKernels& kernels = which == 0 ? RowKernels::Portable() : RowKernels::Get();
      const PixelRow pixels{x, y, stretch, distance[which], surface[which], light[which], 8, 0};
      missed[which] = kernels.settle_on_ground(grid, world, inverse, 255, pixels, slope[which]);
      kernels.shade_ground(look, world, slope[which], 255 & ~missed[which], pixels);
    }
    EXPECT_EQ(missed[0], missed[1]);
    EXPECT_EQ(std::memcmp(distance[0], distance[1], sizeof distance[0]), 0);
    EXPECT_EQ(std::memcmp(slope[0], slope[1], sizeof slope[0]), 0);
    EXPECT_EQ(std::memcmp(light[0], light[1], sizeof light[0]), 0);
    for (int i = 0; i < 8; ++i) {
      if (missed[0] >> i & 1) continue;
      ++settled;
      const double depth = distance[0][i] / stretch[i];
      const double z = 80 + depth * (0.02 * x[i] + 0.01 * y[i] - 1);
      EXPECT_NEAR(z, grid.Height(1 + depth * x[i], 2 - depth * y[i]), 6e-3);
    }
  }
  EXPECT_GT(settled, 700);
}

}  // namespace facets_test
}  // namespace mapmend::simulate

#include "tools/simulate/renderer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/simulate/random.h"
#include "tools/simulate/trajectory.h"

namespace mapmend::simulate {
namespace renderer_test {

// Hilly dark ground of one colour.
void SetGround(Scene* scene, double size, double hills) {
  HeightGrid& grid = scene->grid;
  grid.x0 = grid.y0 = -size / 2;
  grid.spacing = 0.5;
  grid.width = grid.height = static_cast<int>(size / grid.spacing) + 1;
  grid.z.resize(static_cast<size_t>(grid.width) * grid.height);
  for (int j = 0; j < grid.height; ++j) {
    for (int i = 0; i < grid.width; ++i) {
      grid.At(i, j) = static_cast<float>(hills * Fbm(i / 17.0, j / 17.0, 3, 0.5, 5));
    }
  }
  scene->ground = std::make_shared<Texture>(Image(16, 16, Rgb(20, 20, 20)));
  scene->ground_texels_per_metre = 16 / size;
}

void AddPlainBox(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, const Color& color) {
  Solid box = MakeBox(center, size, 0.3);
  for (Face& face : box.faces) face.color = color;
  scene->solids.push_back(box);
}

Camera MakeCamera(int width, int height, double focal) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = (width - 1) / 2.0 + 3.3;
  camera.cy = (height - 1) / 2.0 - 2.1;
  return camera;
}

Rigid3 MovingPose(double time) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.4 * time, Eigen::Vector3d(0.3, 0.9, 0.2).normalized()));
  return {LookAlong(0.7, 1.35) * turn, Eigen::Vector3d(-4 + 6 * time, -6 + 3 * time, 40)};
}

// Renders flat white plates in known places and compares the centroids of their images with those of their outlines
// projected by Camera::Project, the pose being that of the row where a point is seen.
double LargestReprojectionError(const Camera& camera, double readout, double exposure) {
  Scene scene;
  SetGround(&scene, 120, 0);
  std::vector<Eigen::Vector3d> plates;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) {
      plates.emplace_back(i * 7.0 + 0.37 * j, j * 5.0 + 0.2 * i, 2.2 + 0.4 * (i + j));
      AddPlainBox(&scene, plates.back(), {1.2, 1.2, 0.002}, Rgb(250, 250, 250));
    }
  }
  scene.Build();
  RenderOptions options;
  options.exposure = exposure;
  options.readout = readout;
  Renderer renderer(&scene, camera, options);
  SensorState sensor;
  sensor.noise = 0;
  sensor.vignetting = 0;
  Frame frame;
  renderer.Render(MovingPose, 0.5, sensor, &frame);
  double largest = 0;
  int seen = 0;
  for (const Eigen::Vector3d& plate : plates) {
    // The centroid of the projected outline (shoelace formula): that of an area, as measured below, is not the image of
    // its middle.
    double area = 0;
    Eigen::Vector2d expected = Eigen::Vector2d::Zero(), last = Eigen::Vector2d::Zero();
    const Eigen::Vector3d u(0.6 * std::cos(0.3), 0.6 * std::sin(0.3), 0), v(-u.y(), u.x(), 0);
    constexpr int kSide = 12;
    for (int k = 0; k <= 4 * kSide; ++k) {
      const double along = 2.0 * (k % kSide) / kSide - 1;
      const int side = k / kSide % 4;
      const double a = side == 0 ? along : side == 1 ? 1 : side == 2 ? -along : -1;
      const double b = side == 0 ? -1 : side == 1 ? along : side == 2 ? 1 : -along;
      const Eigen::Vector3d point = plate + a * u + b * v + Eigen::Vector3d(0, 0, 0.001);
      double row = camera.cy;
      Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
      for (int i = 0; i < 12; ++i) {
        pixel = camera.Project(MovingPose(0.5 + (row / (camera.height - 1) - 0.5) * readout).Inverse() * point);
        row = pixel.y();
      }
      if (k > 0) {
        const double cross = last.x() * pixel.y() - pixel.x() * last.y();
        area += cross / 2;
        expected += cross * (last + pixel) / 6;
      }
      last = pixel;
    }
    expected /= area;
    const int radius = 20;
    if (expected.x() < radius || expected.y() < radius || expected.x() > camera.width - radius - 1 ||
        expected.y() > camera.height - radius - 1)
      continue;
    ++seen;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0;
    for (int y = static_cast<int>(expected.y()) - radius; y <= expected.y() + radius; ++y) {
      for (int x = static_cast<int>(expected.x()) - radius; x <= expected.x() + radius; ++x) {
        const double value = frame.bgr[3 * (static_cast<size_t>(y) * camera.width + x)];
        const double light = value * value - 400;  // the blur is linear in light, the square of the stored value
        if (light < 30) continue;
        sum += light * Eigen::Vector2d(x, y);
        weight += light;
      }
    }
    largest = std::max(largest, (sum / weight - expected).norm());
  }
  EXPECT_GE(seen, 8);
  return largest;
}

TEST(Renderer, TruthReprojectsToATenthOfAPixel) {
  Camera pinhole = MakeCamera(640, 480, 500);
  EXPECT_LT(LargestReprojectionError(pinhole, 0, 0), 0.1);
  EXPECT_LT(LargestReprojectionError(pinhole, 0, 0.01), 0.1) << "blur is symmetric about the middle of the exposure";
  EXPECT_LT(LargestReprojectionError(pinhole, 0.03, 0.004), 0.1) << "rolling shutter";
  pinhole.distortion = {-0.2, 0.05, 0.002, -0.003, 0.01};
  EXPECT_LT(LargestReprojectionError(pinhole, 0.02, 0.004), 0.1) << "radial-tangential";
  Camera fisheye = MakeCamera(640, 480, 300);
  fisheye.model = Camera::Model::kFisheye;
  fisheye.distortion = {0.03, -0.01, 0.003, -0.0005, 0};
  EXPECT_LT(LargestReprojectionError(fisheye, 0.02, 0.004), 0.1) << "fisheye";
}

TEST(Renderer, DepthsAreThoseOfTheSurface) {
  Scene scene;
  SetGround(&scene, 120, 4);
  AddPlainBox(&scene, {3, 2, 3}, {6, 5, 6}, Rgb(200, 100, 100));
  scene.Build();
  const Camera camera = MakeCamera(160, 120, 110);
  Renderer renderer(&scene, camera, {});
  Frame frame;
  renderer.Render(MovingPose, 0.5, {}, &frame);
  const Rigid3 pose = MovingPose(0.5);
  const Solid& box = scene.solids[0];
  int on_ground = 0, on_box = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const float distance = renderer.Distances()[static_cast<size_t>(y) * camera.width + x];
      if (!std::isfinite(distance)) continue;
      const Eigen::Vector3d point = pose * (renderer.Ray(x, y) * distance);
      const Eigen::Vector2d back = camera.Project(pose.Inverse() * point);
      EXPECT_NEAR((back - Eigen::Vector2d(x, y)).norm(), 0, 0.01);
      double outside = -1e9;
      for (const Face& face : box.faces) outside = std::max(outside, face.normal.dot(point) - face.offset);
      if (std::abs(outside) < 0.01) {
        ++on_box;
      } else {
        EXPECT_NEAR(point.z(), scene.grid.Height(point.x(), point.y()), 0.01);
        ++on_ground;
      }
    }
  }
  EXPECT_GT(on_ground, 10000);
  EXPECT_GT(on_box, 100);
}

// Against stepping along the ray in small steps, which needs no structure.
TEST(Scene, CastFindsTheFirstSurface) {
  Scene scene;
  SetGround(&scene, 60, 6);
  Random random(3);
  for (int k = 0; k < 12; ++k) {
    AddPlainBox(&scene, {random.Uniform(-25, 25), random.Uniform(-25, 25), random.Uniform(-1, 6)},
                {random.Uniform(0.5, 6), random.Uniform(0.5, 6), random.Uniform(0.5, 6)}, Rgb(1, 2, 3));
  }
  scene.Build();
  const auto inside = [&](const Eigen::Vector3d& p) {
    if (std::abs(p.x()) > 30 || std::abs(p.y()) > 30) return false;
    if (p.z() < scene.grid.Height(p.x(), p.y())) return true;
    for (const Solid& solid : scene.solids) {
      double outside = -1e9;
      for (const Face& face : solid.faces) outside = std::max(outside, face.normal.dot(p) - face.offset);
      if (outside < 0) return true;
    }
    return false;
  };
  int hits = 0;
  for (int k = 0; k < 400; ++k) {
    const Eigen::Vector3d origin(random.Uniform(-28, 28), random.Uniform(-28, 28), random.Uniform(8, 30));
    if (inside(origin)) continue;
    const Eigen::Vector3d direction =
        Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 0.1)).normalized();
    const Hit hit = scene.Cast(origin, direction);
    constexpr double kStep = 0.01;
    double stepped = 0;
    while (stepped < 120 && !inside(origin + stepped * direction)) stepped += kStep;
    if (stepped >= 120) {
      EXPECT_EQ(hit.surface, Hit::kNothing);
    } else if (hit.surface == Hit::kNothing || std::abs(hit.distance - stepped) > 3 * kStep) {
      // Stepping may jump over a corner that the exact ray touches.
      ASSERT_NE(hit.surface, Hit::kNothing) << "ray " << k << " missed at " << stepped;
      EXPECT_TRUE(hit.distance < stepped && !inside(origin + (hit.distance + 0.02) * direction))
          << "ray " << k << ": " << hit.distance << " against " << stepped;
    } else {
      ++hits;
    }
  }
  EXPECT_GT(hits, 120);
}

// The blur along each pixel's motion against the mean of many sharp pictures, on a textured plane.
TEST(Renderer, BlurEqualsTheMeanOfSubFrames) {
  Scene scene;
  SetGround(&scene, 120, 0);
  Image stripes(1200, 1200);
  for (int y = 0; y < 1200; ++y) {
    for (int x = 0; x < 1200; ++x) {
      const double v = 128 + 90 * Fbm(x / 9.0, y / 9.0, 3, 0.5, 8);
      stripes.At(x, y) = Pack(Rgb(v, v, v));
    }
  }
  scene.ground = std::make_shared<Texture>(std::move(stripes));
  scene.ground_texels_per_metre = 10;
  scene.Build();
  const Camera camera = MakeCamera(200, 150, 160);
  SensorState sensor;
  sensor.noise = 0;
  RenderOptions options;
  options.exposure = 0.06;
  Frame blurred, sharp, still;
  Renderer renderer(&scene, camera, options);
  renderer.Render(MovingPose, 0.5, sensor, &blurred);
  options.exposure = 0;
  Renderer instant(&scene, camera, options);
  instant.Render(MovingPose, 0.5, sensor, &still);
  constexpr int kSubFrames = 64;
  std::vector<double> mean(blurred.bgr.size());
  for (int k = 0; k < kSubFrames; ++k) {
    instant.Render(MovingPose, 0.5 + 0.06 * ((k + 0.5) / kSubFrames - 0.5), sensor, &sharp);
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += static_cast<double>(sharp.bgr[i]) * sharp.bgr[i] / kSubFrames;
  }
  double error = 0, without = 0;
  int count = 0;
  for (int y = 15; y < 135; ++y) {
    for (int x = 15; x < 185; ++x) {
      const size_t i = 3 * (static_cast<size_t>(y) * 200 + x);
      error += std::abs(blurred.bgr[i] - std::sqrt(mean[i]));
      without += std::abs(still.bgr[i] - std::sqrt(mean[i]));
      ++count;
    }
  }
  EXPECT_LT(error / count, 1.0);
  EXPECT_GT(without / count, 4.0) << "the picture must differ without blur, or this tests nothing";
}

}  // namespace renderer_test
}  // namespace mapmend::simulate

#include "tools/simulate/street.h"

#include <Eigen/Geometry>

#include "tools/simulate/canvas.h"
#include "tools/simulate/parallel.h"

namespace mapmend::simulate {
namespace {

constexpr double kRoad = 4, kPavement = 7.5;  // half the road, and to the houses; metres from the middle line
constexpr double kMargin = 34;                // beyond the middle line

void PaintFacade(Canvas* canvas, const MaterialLibrary& materials, Random* random) {
  const double width = canvas->Width(), height = canvas->Height();
  const uint64_t seed = random->Next();
  const bool brick = random->Int(2) == 0;
  const Color base = brick ? Rgb(random->Uniform(110, 180), random->Uniform(70, 120), random->Uniform(55, 105))
                           : MutedColor(random, 140, 225);
  canvas->Fill(0, 0, width, height, [&](double x, double y, const Color&) {
    const double dirt = 0.12 * Fbm(x / 1.7, y / 3.1, 5, 0.62, seed + 3);
    const Color wall =
        brick ? Bricks(x, y, base, seed) : base * static_cast<float>(1 + 0.05 * Fbm(x / 0.06, y / 0.06, 2, 0.7, seed));
    return wall * static_cast<float>(1 + dirt);
  });
  canvas->Rect(0, 0, width, 0.25, base * 1.2f);
  canvas->Rect(0, 0.25, width, 0.06, base * 0.6f);
  const double floor_height = random->Uniform(2.9, 3.4), step = random->Uniform(1.8, 3.0);
  const double win_w = step * random->Uniform(0.4, 0.6), win_h = random->Uniform(1.2, 1.9);
  const Color frame = random->Int(3) == 0 ? Rgb(70, 60, 52) : Rgb(232, 230, 224);
  for (double y = height - 2 * floor_height + 0.7; y > 0.2; y -= floor_height) {
    for (double x = step * 0.35; x + win_w < width - 0.2; x += step) {
      if (random->Uniform() < 0.06) continue;
      canvas->Rect(x - 0.07, y - 0.07, win_w + 0.14, win_h + 0.2, frame);
      const double dark = random->Uniform(0.7, 1.5);
      const uint64_t glass = random->Next();
      canvas->Fill(x, y, win_w, win_h, [&](double px, double py, const Color&) {
        return Rgb(58, 68, 80) * static_cast<float>(dark * (1 + 0.5 * Fbm(px, py / 0.7, 3, 0.6, glass)));
      });
      if (random->Int(3) == 0)
        canvas->Rect(x, y, win_w * random->Uniform(0.2, 1), win_h * random->Uniform(0.2, 0.9), Rgb(190, 184, 170));
      canvas->Rect(x + win_w / 2 - 0.03, y, 0.06, win_h, frame);
      if (random->Int(2) == 0) canvas->Rect(x, y + win_h * 0.4, win_w, 0.05, frame);
    }
    canvas->Rect(0, y + win_h + 0.55, width, 0.1, base * 1.15f);
  }
  // Ground floor: shops with signs, doors, garages.
  for (double x = 0.4; x < width - 1.5;) {
    const double w = std::min(random->Uniform(1.2, 4.5), width - x - 0.3);
    if (w > 2 && random->Int(2) == 0) {
      canvas->Rect(x, height - 2.9, w, 0.6, MutedColor(random, 20, 210));
      canvas->Print(x + 0.2, height - 2.85, w - 0.4, 0.5, 0.42, Rgb(245, 240, 225), random);
      canvas->Rect(x, height - 2.25, w, 1.9, Rgb(50, 58, 66));
      canvas->Photo(x + 0.1, height - 2.1, w - 0.2, 1.5, materials.photos, random);
      canvas->Rect(x + w * 0.5, height - 2.25, 0.06, 1.9, frame);
    } else {
      const Color door = Rgb(random->Uniform(40, 160), random->Uniform(40, 120), random->Uniform(40, 120));
      canvas->Rect(x, height - 2.5, std::min(w, 1.3), 2.5, frame);
      canvas->Rect(x + 0.1, height - 2.4, std::min(w, 1.3) - 0.2, 2.4, door);
      canvas->Rect(x + 0.3, height - 2.1, 0.5, 0.7, Rgb(64, 72, 84));
      if (w > 2.4) {
        canvas->Rect(x + 1.6, height - 1.9, w - 1.9, 1.1, frame);
        canvas->Rect(x + 1.7, height - 1.8, w - 2.1, 0.9, Rgb(66, 76, 88));
      }
    }
    x += w + random->Uniform(0.3, 1);
  }
  if (random->Int(2) == 0) canvas->Rect(width - 0.25, 0.3, 0.1, height - 0.3, Rgb(110, 108, 104));
}

void AddBuilding(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw,
                 const std::array<bool, 4>& sides, const MaterialLibrary& materials, Random* random) {
  BoxPaint paint;
  paint.texels_per_metre = 36;
  paint.plain = Rgb(random->Uniform(120, 190), random->Uniform(115, 180), random->Uniform(105, 170));
  paint.side = [&](int side, Canvas* canvas) {
    if (!sides[side]) return false;
    PaintFacade(canvas, materials, random);
    return true;
  };
  AddPaintedBox(scene, center, size, yaw, paint);
}

// Houses side by side on one side of a leg of the street, from `from` towards `to`; `out` points away from the road.
void AddRow(Scene* scene, const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Eigen::Vector3d& out,
            double depth, const MaterialLibrary& materials, Random* random) {
  const Eigen::Vector3d along = (to - from).normalized();
  const double length = (to - from).norm(), yaw = std::atan2(along.y(), along.x());
  for (double s = 0; s < length - 4;) {
    double width = std::min(random->Uniform(8, 18), length - s);
    if (length - s - width < 6) width = length - s;
    const double height = random->Uniform(7, 16), gap = random->Uniform() < 0.12 ? 3.0 : 0.0,
                 back = random->Uniform(0, 0.8);
    const Eigen::Vector3d center =
        from + (s + width / 2) * along + (back + depth / 2) * out + Eigen::Vector3d(0, 0, height / 2 - 0.1);
    const Eigen::Vector3d y(-along.y(), along.x(), 0);
    const bool front_is_minus_y = y.dot(out) > 0;
    AddBuilding(scene, center, {width - gap, depth, height}, yaw, {true, true, !front_is_minus_y, front_is_minus_y},
                materials, random);
    s += width;
  }
}

void AddCar(Scene* scene, const Eigen::Vector3d& at, double yaw, Random* random) {
  const Color paint = MutedColor(random, 20, 235);
  const Eigen::Vector3d u(std::cos(yaw), std::sin(yaw), 0);
  const auto body = [&](const Eigen::Vector3d& center, const Eigen::Vector3d& size, const Color& color, bool windows) {
    BoxPaint box;
    box.texels_per_metre = 60;
    box.plain = color;
    box.side = [&](int side, Canvas* canvas) {
      canvas->Rect(0, 0, canvas->Width(), canvas->Height(), color);
      if (windows) {
        canvas->Rect(0.08, 0.05, canvas->Width() - 0.16, canvas->Height() - 0.1, Rgb(40, 46, 54));
        if (side >= 2) canvas->Rect(canvas->Width() / 2 - 0.04, 0, 0.08, canvas->Height(), color);
        return true;
      }
      if (side >= 2) {
        for (const double x : {0.55, canvas->Width() - 1.15}) {
          canvas->Fill(x, canvas->Height() - 0.5, 0.6, 0.5, [&](double px, double py, const Color& old) {
            const double r = std::hypot(px - x - 0.3, py - canvas->Height() + 0.2);
            return r < 0.16 ? Rgb(150, 150, 155) : r < 0.3 ? Rgb(28, 28, 30) : old;
          });
        }
        canvas->Rect(1.9, 0.1, 0.02, 0.5, color * 0.6f);
        canvas->Rect(1.5, 0.18, 0.16, 0.04, color * 0.6f);
      } else {
        const Color lamp = side == 0 ? Rgb(245, 245, 225) : Rgb(180, 30, 30);
        canvas->Rect(0.1, 0.15, 0.3, 0.15, lamp);
        canvas->Rect(canvas->Width() - 0.4, 0.15, 0.3, 0.15, lamp);
        canvas->Rect(canvas->Width() / 2 - 0.26, 0.4, 0.52, 0.12, Rgb(235, 235, 230));
        canvas->Print(canvas->Width() / 2 - 0.26, 0.4, 0.52, 0.12, 0.1, Rgb(20, 20, 30), random);
      }
      return true;
    };
    AddPaintedBox(scene, center, size, yaw, box);
  };
  body(at + Eigen::Vector3d(0, 0, 0.52), {4.4, 1.78, 0.74}, paint, false);
  body(at - 0.3 * u + Eigen::Vector3d(0, 0, 1.17), {2.3, 1.6, 0.56}, paint, true);
}

// A trunk and a crown with eight sides.
void AddTree(Scene* scene, const Eigen::Vector3d& at, int leaves, double leaf_scale, Random* random) {
  BoxPaint trunk;
  trunk.plain = Rgb(92, 76, 60);
  AddPaintedBox(scene, at + Eigen::Vector3d(0, 0, 1.4), {0.28, 0.28, 2.8}, random->Uniform(0, 3), trunk);
  for (int k = 0; k < 3; ++k) {
    const double radius = random->Uniform(1.0, 1.7);
    const Eigen::Vector3d center =
        at + Eigen::Vector3d(random->Uniform(-0.7, 0.7), random->Uniform(-0.7, 0.7), random->Uniform(3, 4.6));
    Solid crown;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(random->Uniform(0, 3), Eigen::Vector3d(0.2, 0.3, 1).normalized()));
    for (int f = 0; f < 8; ++f) {
      Face face;
      face.normal = turn * Eigen::Vector3d(f & 1 ? 1 : -1, f & 2 ? 1 : -1, f & 4 ? 1 : -1).normalized();
      face.offset = face.normal.dot(center) + radius * 0.75;
      const Eigen::Vector3d u = face.normal.unitOrthogonal(), v = face.normal.cross(u);
      LayTexture(&face, leaves, center - (2 + 3 * random->Uniform()) * u - (2 + 3 * random->Uniform()) * v, u, v,
                 leaf_scale);
      const float light = 0.6f + 0.35f * static_cast<float>(face.normal.z());
      face.color = Color{light, light, light, 1};
      crown.faces.push_back(face);
    }
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(radius * 1.3);
    crown.low = center - reach;
    crown.high = center + reach;
    scene->solids.push_back(std::move(crown));
  }
}

void SetGround(Scene* scene, double width, double length, uint64_t seed, const MaterialLibrary& materials,
               int num_threads) {
  HeightGrid& grid = scene->grid;
  grid.x0 = grid.y0 = -kMargin;
  grid.spacing = 1;
  grid.width = static_cast<int>(width + 2 * kMargin) + 1;
  grid.height = static_cast<int>(length + 2 * kMargin) + 1;
  grid.z.assign(static_cast<size_t>(grid.width) * grid.height, 0.f);
  const double scale = std::min(40.0, std::sqrt(4e7 / (grid.width * grid.height)));
  scene->ground_texels_per_metre = scale;
  Image ground(static_cast<int>((grid.width - 1) * scale), static_cast<int>((grid.height - 1) * scale));
  ParallelFor(ground.height, 64, num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < ground.width; ++i) {
        const double x = grid.x0 + (i + 0.5) / scale, y = grid.y0 + (j + 0.5) / scale;
        // Distance to the middle line of the rectangle, and position along the nearest leg.
        const double ox = std::max({-x, x - width, 0.0}), oy = std::max({-y, y - length, 0.0});
        const double inside = std::min(std::min(x, width - x), std::min(y, length - y));
        const double d = ox > 0 || oy > 0 ? std::hypot(ox, oy) : inside;
        const double along =
            std::min(std::abs(x), std::abs(x - width)) < std::min(std::abs(y), std::abs(y - length)) ? y : x;
        Color color = {};
        if (d < kRoad) {
          color = Asphalt(x, y, seed);
          const double dash = along / 6 - std::floor(along / 6);
          const bool line = (d < 0.07 && dash < 0.5) || std::abs(d - 1.9 - 0.3) < 0.05;
          if (line && Fbm(x / 0.5, y / 0.5, 3, 0.6, seed + 2) > -0.35) color = Rgb(205, 205, 196);
          // Patches, manholes and stains.
          const uint64_t cell = Hash(seed, static_cast<uint64_t>(static_cast<int64_t>(std::floor(x / 7))),
                                     static_cast<uint64_t>(static_cast<int64_t>(std::floor(y / 7))));
          const double mx = x / 7 - std::floor(x / 7) - 0.2 - 0.6 * Unit(cell),
                       my = y / 7 - std::floor(y / 7) - 0.2 - 0.6 * Unit(Hash(cell));
          if (cell % 3 == 0 && std::hypot(mx, my) < 0.045)
            color = Rgb(70, 68, 66) * (std::fmod(std::abs(mx) * 700, 2) < 1 ? 1.3f : 1.f);
          if (cell % 3 == 1 && std::abs(mx) < 0.2 && std::abs(my) < 0.11) color *= 0.72f;
        } else if (d < kRoad + 0.2) {
          color = Rgb(176, 172, 166);
        } else if (d < kPavement + 1) {
          color = Concrete(x * 1.7, y * 1.7, seed + 1);
        } else {
          color = materials.dry_lawn.At(x * 12, y * 12, seed);
        }
        ground.At(i, j) = Pack(color);
      }
    }
  });
  scene->ground = std::make_shared<Texture>(std::move(ground), num_threads);
  scene->survey_height = 60;
}

}  // namespace

std::unique_ptr<Scene> BuildStreetScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                        int num_threads) {
  auto scene = std::make_unique<Scene>();
  SetGround(scene.get(), width, length, seed, materials, num_threads);
  Random random(seed + 5);
  constexpr double kLeafScale = 40;
  Canvas leaves(8, 8, kLeafScale);
  leaves.Fill(0, 0, 8, 8, [&](double x, double y, const Color&) {
    return materials.bush.At(x * kLeafScale, y * kLeafScale, seed);
  });
  const int leaf_texture = static_cast<int>(scene->textures.size());
  scene->textures.push_back(leaves.Finish());

  const double in = kPavement, depth = 12;
  const Eigen::Vector3d corners[] = {{0, 0, 0}, {width, 0, 0}, {width, length, 0}, {0, length, 0}};
  for (int leg = 0; leg < 4; ++leg) {
    const Eigen::Vector3d a = corners[leg], b = corners[(leg + 1) % 4];
    const Eigen::Vector3d along = (b - a).normalized(), left(-along.y(), along.x(), 0);  // left is inside
    const double leg_length = (b - a).norm();
    AddRow(scene.get(), a - in * left - (in + depth) * along, b - in * left + in * along, -left, depth, materials,
           &random);
    AddRow(scene.get(), a + in * left + in * along, b + in * left - (in + depth) * along, left,
           std::min(depth, std::min(width, length) / 2 - in - 1), materials, &random);
    for (const double side : {-1.0, 1.0}) {
      for (double s = random.Uniform(9, 14); s < leg_length - 9; s += random.Uniform(5.5, 12)) {
        const Eigen::Vector3d at = a + s * along + side * 3.0 * left;
        const double yaw = std::atan2(along.y(), along.x()) + (side > 0 ? 3.141592653589793 : 0);
        if (random.Uniform() < 0.6) AddCar(scene.get(), at, yaw + random.Uniform(-0.03, 0.03), &random);
      }
      for (double s = random.Uniform(8, 16); s < leg_length - 8; s += random.Uniform(12, 22)) {
        const Eigen::Vector3d at = a + s * along + side * 4.8 * left;
        if (random.Int(2) == 0) {
          AddTree(scene.get(), at, leaf_texture, kLeafScale, &random);
        } else {
          BoxPaint post;
          post.plain = Rgb(78, 84, 82);
          AddPaintedBox(scene.get(), at + Eigen::Vector3d(0, 0, 2.6), {0.12, 0.12, 5.2}, 0, post);
          AddPaintedBox(scene.get(), at + Eigen::Vector3d(0, 0, 5.2) - side * 0.5 * left, {0.5, 0.5, 0.12}, 0, post);
        }
      }
    }
  }
  scene->Build();
  return scene;
}

}  // namespace mapmend::simulate

#include "tools/simulate/indoor.h"

#include "tools/simulate/canvas.h"
#include "tools/simulate/parallel.h"

namespace mapmend::simulate {
namespace {

constexpr double kRoomHeight = 2.8, kWall = 0.2, kWallScale = 200, kCorridor = 2.4;

Color RandomPaint(Random* random, double low = 60, double high = 230) { return MutedColor(random, low, high); }

// A flat floor whose picture is carpet.
void SetFloor(Scene* scene, double width, double length, const Color& color, uint64_t seed, int num_threads) {
  HeightGrid& grid = scene->grid;
  grid.x0 = grid.y0 = -1;
  grid.spacing = 0.25;
  grid.width = static_cast<int>((width + 2) / grid.spacing) + 1;
  grid.height = static_cast<int>((length + 2) / grid.spacing) + 1;
  grid.z.assign(static_cast<size_t>(grid.width) * grid.height, 0.f);
  scene->ground_texels_per_metre = width * length > 400 ? 100 : 160;
  Image floor(static_cast<int>((width + 2) * scene->ground_texels_per_metre),
              static_cast<int>((length + 2) * scene->ground_texels_per_metre));
  ParallelFor(floor.height, 64, num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < floor.width; ++i) {
        const double x = i / scene->ground_texels_per_metre, y = j / scene->ground_texels_per_metre;
        // Carpet tiles, each laid its own way.
        const double a = std::floor(x / 0.5), b = std::floor(y / 0.5);
        const uint64_t tile = Hash(seed, static_cast<uint64_t>(a) * 4096 + static_cast<uint64_t>(b));
        const bool turned = tile & 1;
        const double shade = 0.9 + 0.25 * Unit(Hash(tile));
        floor.At(i, j) = Pack(Carpet(turned ? y : x, turned ? x : y, color * static_cast<float>(shade), tile));
      }
    }
  });
  scene->ground = std::make_shared<Texture>(std::move(floor), num_threads);
  scene->survey_height = kRoomHeight - 0.05;
}

// A door, and its frame.
void PaintDoor(Canvas* canvas, double x, double used, Random* random) {
  const double height = canvas->Height();
  const Color wood = RandomPaint(random, 80, 190);
  const uint64_t grain = random->Next();
  canvas->Rect(x - 0.06, height - 2.16, used + 0.12, 2.16, Rgb(225, 222, 215));
  canvas->Fill(x, height - 2.1, used, 2.1,
               [&](double px, double py, const Color&) { return Wood(py, px, wood, grain); });
  canvas->Rect(x + 0.83, height - 1.08, 0.06, 0.16, Rgb(200, 200, 205));
  canvas->Rect(x + 0.79, height - 1.03, 0.1, 0.02, Rgb(60, 60, 62));
  if (random->Int(2) == 0) canvas->Rect(x + 0.3, height - 1.9, 0.35, 0.6, Rgb(70, 84, 96));
  canvas->Rect(x + 0.36, height - 1.62, 0.24, 0.1, Rgb(245, 245, 240));
  canvas->Print(x + 0.36, height - 1.62, 0.24, 0.1, 0.045, Rgb(30, 30, 40), random);
}

// A board with notes and pictures pinned to it.
void PaintNoticeBoard(Canvas* canvas, double x, double used, const MaterialLibrary& materials, Random* random) {
  const double top = random->Uniform(0.8, 1.0), tall = 0.9;
  canvas->Rect(x, top, used, tall, Rgb(90, 70, 50));
  const Color cork = RandomPaint(random, 120, 190);
  const uint64_t grain = random->Next();
  canvas->Fill(x + 0.03, top + 0.03, used - 0.06, tall - 0.06, [&](double px, double py, const Color&) {
    return cork * static_cast<float>(1 + 0.12 * Fbm(px / 0.02, py / 0.02, 2, 0.7, grain));
  });
  for (int sheets = 2 + random->Int(8); sheets > 0; --sheets) {
    const double w = random->Uniform(0.12, 0.32), h = w * random->Uniform(0.7, 1.5);
    const double sx = x + 0.05 + random->Uniform() * std::max(0.0, used - 0.1 - w),
                 sy = top + 0.05 + random->Uniform() * std::max(0.0, tall - 0.1 - h);
    if (random->Int(3) == 0) {
      canvas->Photo(sx, sy, w, h, materials.photos, random);
    } else {
      canvas->Rect(sx, sy, w, h, RandomPaint(random, 190, 250));
      canvas->Print(sx + 0.01, sy + 0.01, w - 0.02, h - 0.02, random->Uniform(0.018, 0.04), RandomPaint(random, 10, 90),
                    random);
    }
  }
}

// A switch above, a socket below.
void PaintSocket(Canvas* canvas, double x) {
  const double height = canvas->Height();
  canvas->Rect(x, height - 1.35, 0.09, 0.14, Rgb(238, 238, 232));
  canvas->Rect(x + 0.02, height - 1.31, 0.05, 0.06, Rgb(190, 190, 186));
  canvas->Rect(x + 0.1, height - 0.38, 0.14, 0.09, Rgb(236, 236, 230));
  canvas->Rect(x + 0.13, height - 0.36, 0.03, 0.04, Rgb(40, 40, 40));
}

// A wall as people leave it: paint with traces, skirting, doors, posters, notice boards, sockets.
void PaintWall(Canvas* canvas, const MaterialLibrary& materials, bool doors, Random* random) {
  const double width = canvas->Width(), height = canvas->Height();
  const Color paint = MutedColor(random, 165, 230);
  const uint64_t seed = random->Next();
  canvas->Fill(0, 0, width, height, [&](double x, double y, const Color&) {
    const double mark = Fbm(x / 0.9, y / 0.6, 5, 0.65, seed),
                 scratch = std::abs(Fbm(x / 0.5, y / 0.11, 3, 0.6, seed + 1)) < 0.008 ? -0.08 : 0;
    return paint * static_cast<float>(1 + 0.07 * mark + scratch - (y > height - 0.9 ? 0.08 : 0));
  });
  canvas->Rect(0, height - 0.1, width, 0.1, Rgb(110, 100, 92));
  canvas->Rect(0, height - 0.92, width, 0.03, Rgb(130, 118, 105));
  for (double x = random->Uniform(0.2, 0.9); x < width - 0.6;) {
    const double room = width - x - 0.2, kind = random->Uniform();
    double used = 0;
    if (doors && kind < 0.25 && room > 1.1) {
      used = 0.95;
      PaintDoor(canvas, x, used, random);
    } else if (kind < 0.55) {
      used = std::min(room, random->Uniform(0.4, 1.3));
      const double tall = used * random->Uniform(0.6, 0.9);
      canvas->Photo(x, random->Uniform(0.7, 1.0), used, tall, materials.photos, random);
    } else if (kind < 0.85) {
      used = std::min(room, random->Uniform(0.8, 2.2));
      PaintNoticeBoard(canvas, x, used, materials, random);
    } else {
      used = 0.3;
      PaintSocket(canvas, x);
    }
    x += used + random->Uniform(0.15, 0.9);
  }
}

void AddWall(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, int side, bool doors,
             const MaterialLibrary& materials, uint64_t seed) {
  BoxPaint paint;
  paint.texels_per_metre = kWallScale;
  paint.side = [&](int s, Canvas* canvas) {
    if (side >= 0 && s != side) return false;
    Random random(Hash(seed, static_cast<uint64_t>(s)));
    PaintWall(canvas, materials, doors, &random);
    return true;
  };
  AddPaintedBox(scene, center, size, 0, paint);
}

void AddCeiling(Scene* scene, double width, double length, uint64_t seed) {
  BoxPaint paint;
  paint.texels_per_metre = 60;
  paint.bottom = [&](Canvas* canvas) {
    canvas->Fill(0, 0, width, length, [&](double x, double y, const Color&) {
      const double a = x / 0.6 - std::floor(x / 0.6), b = y / 0.6 - std::floor(y / 0.6);
      const double joint = a < 0.03 || b < 0.03 ? -0.18 : 0;
      const uint64_t tile = Hash(seed, static_cast<uint64_t>(x / 0.6) * 977 + static_cast<uint64_t>(y / 0.6));
      if (tile % 11 == 0) return Rgb(250, 250, 248);  // a lamp
      return Rgb(205, 204, 198) *
             static_cast<float>(1 + joint + 0.05 * (Unit(tile) - 0.5) + 0.1 * Fbm(x / 0.04, y / 0.04, 2, 0.7, seed));
    });
    return true;
  };
  AddPaintedBox(scene, {width / 2, length / 2, kRoomHeight + 0.1}, {width, length, 0.2}, 0, paint);
}

void AddOuterWalls(Scene* scene, double width, double length, bool doors, const MaterialLibrary& materials,
                   uint64_t seed) {
  const double z = kRoomHeight / 2;
  AddWall(scene, {width / 2, -kWall / 2, z}, {width, kWall, kRoomHeight}, 2, doors, materials, seed + 1);
  AddWall(scene, {width / 2, length + kWall / 2, z}, {width, kWall, kRoomHeight}, 3, doors, materials, seed + 2);
  AddWall(scene, {-kWall / 2, length / 2, z}, {kWall, length, kRoomHeight}, 0, doors, materials, seed + 3);
  AddWall(scene, {width + kWall / 2, length / 2, z}, {kWall, length, kRoomHeight}, 1, doors, materials, seed + 4);
}

// A box of a given look: wood, print, or a photograph on each side.
void AddThing(Scene* scene, const Eigen::Vector3d& center, const Eigen::Vector3d& size, double yaw,
              const MaterialLibrary& materials, Random* random) {
  BoxPaint paint;
  paint.texels_per_metre = 260;
  paint.plain = RandomPaint(random);
  const auto cover = [&](Canvas* canvas) {
    const Color base = RandomPaint(random, 50, 235);
    const uint64_t grain = random->Next();
    canvas->Fill(0, 0, canvas->Width(), canvas->Height(),
                 [&](double x, double y, const Color&) { return Wood(x, y, base, grain); });
    if (random->Int(2) == 0)
      canvas->Photo(0.1 * canvas->Width(), 0.1 * canvas->Height(), 0.8 * canvas->Width(), 0.5 * canvas->Height(),
                    materials.photos, random);
    canvas->Print(0.05 * canvas->Width(), 0.6 * canvas->Height(), 0.9 * canvas->Width(), 0.36 * canvas->Height(),
                  std::max(0.015, 0.12 * canvas->Height()), RandomPaint(random, 0, 255), random);
    return true;
  };
  paint.side = [&](int, Canvas* canvas) { return cover(canvas); };
  paint.top = cover;
  AddPaintedBox(scene, center, size, yaw, paint);
}

void AddDesk(Scene* scene, double x, double y, double yaw, const MaterialLibrary& materials, Random* random) {
  const double width = random->Uniform(1.3, 1.7), depth = 0.8, height = 0.74;
  const Color wood = RandomPaint(random, 110, 210);
  const uint64_t grain = random->Next();
  const Eigen::Vector3d u(std::cos(yaw), std::sin(yaw), 0), v(-u.y(), u.x(), 0), at(x, y, 0);
  BoxPaint paint;
  paint.texels_per_metre = 260;
  paint.plain = wood * 0.8f;
  paint.top = [&](Canvas* canvas) {
    canvas->Fill(0, 0, width, depth, [&](double px, double py, const Color&) { return Wood(px, py, wood, grain); });
    for (int sheets = 2 + random->Int(6); sheets > 0; --sheets) {
      const double px = random->Uniform(0, width - 0.3), py = random->Uniform(0, depth - 0.3);
      canvas->Rect(px, py, 0.21, 0.29, RandomPaint(random, 200, 250));
      canvas->Print(px + 0.01, py + 0.01, 0.19, 0.27, 0.02, Rgb(40, 40, 50), random);
    }
    return true;
  };
  AddPaintedBox(scene, at + Eigen::Vector3d(0, 0, height), {width, depth, 0.04}, yaw, paint);
  for (const double side : {-1.0, 1.0}) {
    BoxPaint leg;
    leg.plain = Rgb(120, 120, 124);
    AddPaintedBox(scene, at + side * (width / 2 - 0.05) * u + Eigen::Vector3d(0, 0, height / 2),
                  {0.05, depth * 0.9, height - 0.04}, yaw, leg);
  }
  const Eigen::Vector3d top = at + Eigen::Vector3d(0, 0, height + 0.02);
  AddThing(scene, top + random->Uniform(-0.3, 0.3) * u + 0.15 * v + Eigen::Vector3d(0, 0, 0.24), {0.55, 0.06, 0.38},
           yaw + random->Uniform(-0.2, 0.2), materials, random);
  for (int things = 2 + random->Int(4); things > 0; --things) {
    const double w = random->Uniform(0.08, 0.3), d = random->Uniform(0.08, 0.25), h = random->Uniform(0.04, 0.28);
    AddThing(scene,
             top + random->Uniform(-0.42, 0.42) * width * u + random->Uniform(-0.4, 0.1) * depth * v +
                 Eigen::Vector3d(0, 0, h / 2),
             {w, d, h}, yaw + random->Uniform(-1, 1), materials, random);
  }
  AddThing(scene, at - 0.75 * v + random->Uniform(-0.3, 0.3) * u + Eigen::Vector3d(0, 0, 0.24), {0.45, 0.45, 0.06},
           yaw + random->Uniform(-0.5, 0.5), materials, random);
  AddThing(scene, at - 0.96 * v + Eigen::Vector3d(0, 0, 0.62), {0.42, 0.05, 0.5}, yaw + random->Uniform(-0.3, 0.3),
           materials, random);
}

}  // namespace

std::unique_ptr<Scene> BuildOfficeScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                        int num_threads) {
  auto scene = std::make_unique<Scene>();
  SetFloor(scene.get(), width, length, Rgb(120, 128, 136), seed, num_threads);
  AddOuterWalls(scene.get(), width, length, false, materials, seed);
  AddCeiling(scene.get(), width, length, seed);
  Random random(seed + 9);
  // Desks along the walls and an island in the middle; the way round it stays free.
  for (double x = 1.2; x < width - 1; x += 2.1) {
    AddDesk(scene.get(), x, 0.5, 3.141592653589793, materials, &random);
    AddDesk(scene.get(), x, length - 0.5, 0, materials, &random);
  }
  for (double x = 3; x < width - 2.6; x += 1.8) {
    AddDesk(scene.get(), x, length / 2 - 0.45, 0, materials, &random);
    AddDesk(scene.get(), x, length / 2 + 0.45, 3.141592653589793, materials, &random);
  }
  for (double y = 1.6; y < length - 1.4; y += 1.1) {
    const double tall = random.Uniform(0.9, 2.0);
    AddThing(scene.get(), {0.22, y, tall / 2}, {0.4, 0.9, tall}, 0, materials, &random);
    const double low = random.Uniform(0.7, 1.9);
    AddThing(scene.get(), {width - 0.22, y, low / 2}, {0.4, 0.9, low}, 0, materials, &random);
  }
  scene->Build();
  return scene;
}

std::unique_ptr<Scene> BuildCorridorScene(double width, double length, uint64_t seed, const MaterialLibrary& materials,
                                          int num_threads) {
  auto scene = std::make_unique<Scene>();
  SetFloor(scene.get(), width, length, Rgb(128, 118, 106), seed, num_threads);
  AddOuterWalls(scene.get(), width, length, true, materials, seed);
  AddWall(scene.get(), {width / 2, length / 2, kRoomHeight / 2},
          {width - 2 * kCorridor, length - 2 * kCorridor, kRoomHeight}, -1, true, materials, seed + 5);
  AddCeiling(scene.get(), width, length, seed);
  Random random(seed + 9);
  // Things that stand along the outer walls: radiators, boxes, plants.
  for (double along = 3; along < 2 * (width + length); along += random.Uniform(3, 7)) {
    const double s = along;
    const double tall = random.Uniform(0.4, 1.2), wide = random.Uniform(0.3, 0.9);
    Eigen::Vector3d at = s < width                ? Eigen::Vector3d(s, 0.15, 0)
                         : s < width + length     ? Eigen::Vector3d(width - 0.15, s - width, 0)
                         : s < 2 * width + length ? Eigen::Vector3d(s - width - length, length - 0.15, 0)
                                                  : Eigen::Vector3d(0.15, s - 2 * width - length, 0);
    const bool along_x = s < width || (s >= width + length && s < 2 * width + length);
    at.z() = tall / 2;
    AddThing(scene.get(), at, along_x ? Eigen::Vector3d(wide, 0.25, tall) : Eigen::Vector3d(0.25, wide, tall), 0,
             materials, &random);
  }
  scene->Build();
  return scene;
}

}  // namespace mapmend::simulate

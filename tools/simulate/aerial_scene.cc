#include <Eigen/Geometry>

#include "tools/simulate/aerial.h"
#include "tools/simulate/parallel.h"

namespace mapmend::simulate {
namespace {

const Eigen::Vector3d kSun = Eigen::Vector3d(0.45, -0.35, 0.82).normalized();

// Stored brightness of a surface with this normal: sky light and, unless in shadow, the sun. 1 for level ground in the
// sun.
// scatter: how far light goes round edges, as it does in leaves.
double Shading(const Eigen::Vector3d& normal, double sun, double scatter = 0) {
  const double sky = 0.30 * (0.6 + 0.4 * normal.z());
  const double direct =
      0.70 * sun * std::max(0.0, normal.dot(kSun) + scatter) / (1 + scatter) / (kSun.z() + scatter) * (1 + scatter);
  return std::sqrt(sky + direct);  // half-way between light and stored value, as cameras brighten shadows
}

// Vegetation lower than trees: a random height per vertex, where neither roads nor water are.
void AddRoughness(const AerialLayout& layout, HeightGrid* grid) {
  const AerialOptions& options = layout.Options();
  constexpr double kShare[] = {0.12, 0.2, 0.4, 1, 1};  // by Land
  ParallelFor(grid->height, 16, options.num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < grid->width; ++i) {
        double x = grid->x0 + i * grid->spacing;
        const double y = grid->y0 + j * grid->spacing;
        bool water = false;
        for (const Lake& lake : options.lakes) water |= layout.LakeDistance(lake, x, y) < 1.1;
        const AerialLayout::Place place = layout.At(x, y);
        if (water || place.road < 5) continue;
        if (options.repeat_x > 0) x -= options.repeat_x * std::floor((x - options.x0) / options.repeat_x);
        const double high = 0.5 + 0.5 * ValueNoise(x / 0.8, y / 0.8, Hash(options.seed, 21));
        const double clump = std::clamp(0.5 + 1.2 * Fbm(x / 7, y / 7, 3, 0.6, Hash(options.seed, 22)), 0.0, 1.0);
        grid->At(i, j) += static_cast<float>(options.roughness * kShare[static_cast<int>(place.land)] * high * clump);
      }
    }
  });
}

HeightGrid MakeHeights(const AerialLayout& layout, HeightGrid* bare) {
  const AerialOptions& options = layout.Options();
  HeightGrid grid;
  grid.x0 = options.x0;
  grid.y0 = options.y0;
  grid.spacing = options.spacing;
  grid.width = static_cast<int>(std::ceil(options.width / options.spacing)) + 1;
  grid.height = static_cast<int>(std::ceil(options.length / options.spacing)) + 1;
  grid.z.resize(static_cast<size_t>(grid.width) * grid.height);
  std::vector<double> level;
  for (const Lake& lake : options.lakes) level.push_back(layout.Hills(lake.x, lake.y) - 1);
  ParallelFor(grid.height, 16, options.num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < grid.width; ++i) {
        const double x = grid.x0 + i * grid.spacing, y = grid.y0 + j * grid.spacing;
        double z = layout.Hills(x, y);
        for (size_t k = 0; k < level.size(); ++k) {
          // Banks lead down to the water over half the radius of the lake.
          const double out = std::clamp((layout.LakeDistance(options.lakes[k], x, y) - 1.0) / 0.5, 0.0, 1.0);
          z = level[k] + (z - level[k]) * out * out * (3 - 2 * out);
        }
        grid.At(i, j) = static_cast<float>(z);
      }
    }
  });
  *bare = grid;
  if (options.roughness > 0) AddRoughness(layout, &grid);
  for (const Tree& tree : layout.trees) {
    const Crown crown_shape(tree);
    const double reach = tree.radius * 1.1, ground = bare->Height(tree.x, tree.y);
    const int low_i = std::max(0, static_cast<int>((tree.x - reach - grid.x0) / grid.spacing));
    const int low_j = std::max(0, static_cast<int>((tree.y - reach - grid.y0) / grid.spacing));
    const int high_i = std::min(grid.width - 1, static_cast<int>((tree.x + reach - grid.x0) / grid.spacing) + 1);
    const int high_j = std::min(grid.height - 1, static_cast<int>((tree.y + reach - grid.y0) / grid.spacing) + 1);
    for (int j = low_j; j <= high_j; ++j) {
      for (int i = low_i; i <= high_i; ++i) {
        const double crown = crown_shape.Height(grid.x0 + i * grid.spacing, grid.y0 + j * grid.spacing);
        if (crown > 0) grid.At(i, j) = std::max(grid.At(i, j), static_cast<float>(ground + crown));
      }
    }
  }
  return grid;
}

// Light on every vertex: slope, and whether the sun is hidden by trees or houses.
std::vector<float> MakeLight(const AerialLayout& layout, const HeightGrid& grid, int num_threads) {
  HeightGrid top = grid;  // houses as well
  for (const House& house : layout.houses) {
    const double reach = 0.5 * std::hypot(house.size_x, house.size_y), c = std::cos(house.yaw), s = std::sin(house.yaw);
    const double ground = grid.Height(house.x, house.y);
    for (int j = std::max(0, static_cast<int>((house.y - reach - grid.y0) / grid.spacing));
         j < grid.height && grid.y0 + j * grid.spacing < house.y + reach; ++j) {
      for (int i = std::max(0, static_cast<int>((house.x - reach - grid.x0) / grid.spacing));
           i < grid.width && grid.x0 + i * grid.spacing < house.x + reach; ++i) {
        const double dx = grid.x0 + i * grid.spacing - house.x, dy = grid.y0 + j * grid.spacing - house.y;
        const double u = c * dx + s * dy, v = -s * dx + c * dy;
        if (std::abs(u) > house.size_x / 2 || std::abs(v) > house.size_y / 2) continue;
        const double roof = house.wall + house.roof * (1 - std::abs(v) / (house.size_y / 2));
        top.At(i, j) = std::max(top.At(i, j), static_cast<float>(ground + roof));
      }
    }
  }
  std::vector<float> light(grid.z.size());
  const double horizontal = std::hypot(kSun.x(), kSun.y());
  const double step_x = kSun.x() / horizontal, step_y = kSun.y() / horizontal,
               rise = kSun.z() / horizontal * grid.spacing;
  ParallelFor(grid.height, 16, num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < grid.width; ++i) {
        const int left = std::max(i - 1, 0), right = std::min(i + 1, grid.width - 1);
        const int down = std::max(j - 1, 0), up = std::min(j + 1, grid.height - 1);
        const Eigen::Vector3d normal =
            Eigen::Vector3d((grid.At(left, j) - grid.At(right, j)) / ((right - left) * grid.spacing),
                            (grid.At(i, down) - grid.At(i, up)) / ((up - down) * grid.spacing), 1)
                .normalized();
        double sun = 1, ray = grid.At(i, j) + 0.2;
        for (int k = 1; k * rise < 14; ++k) {
          const int si = i + static_cast<int>(std::lround(k * step_x)),
                    sj = j + static_cast<int>(std::lround(k * step_y));
          if (si < 0 || sj < 0 || si >= grid.width || sj >= grid.height) break;
          ray += rise;
          const double above = top.At(si, sj) - ray;
          if (above > 0) sun = std::min(sun, std::max(0.12, 1 - above / 0.5));
        }
        light[static_cast<size_t>(j) * grid.width + i] =
            static_cast<float>(std::min(1.25, Shading(normal, sun, normal.z() < 0.8 ? 0.6 : 0)));
      }
    }
  });
  return light;
}

constexpr double kRoofScale = 14, kHouseWallScale = 14;  // texels per metre
constexpr int kNumRoofs = 6, kNumWalls = 5;
constexpr int kRoofTexels = 900, kWallTexels = 1400;  // along a roof, along a wall

void AddRoofTextures(Scene* scene) {
  const Color bases[kNumRoofs] = {Rgb(168, 168, 172), Rgb(140, 136, 134), Rgb(196, 196, 200),
                                  Rgb(150, 112, 88),  Rgb(132, 92, 78),   Rgb(178, 160, 140)};
  for (uint64_t k = 0; k < kNumRoofs; ++k) {
    Image roof(kRoofTexels, kRoofTexels);
    for (int y = 0; y < roof.height; ++y) {
      for (int x = 0; x < roof.width; ++x) roof.At(x, y) = Pack(Shingles(x / kRoofScale, y / kRoofScale, bases[k], k));
    }
    scene->textures.push_back(std::make_shared<Texture>(std::move(roof)));
  }
}

// With windows, some of them doors.
void AddWallTextures(Scene* scene) {
  for (uint64_t k = 0; k < kNumWalls; ++k) {
    Image wall(kWallTexels, 100);
    Random random(k + 90);
    const Color base = Rgb(random.Uniform(170, 225), random.Uniform(165, 215), random.Uniform(150, 200));
    for (int y = 0; y < wall.height; ++y) {
      for (int x = 0; x < wall.width; ++x)
        wall.At(x, y) = Pack(base * static_cast<float>(1 + 0.08 * Fbm(x / 20.0, y / 20.0, 3, 0.6, k)));
    }
    for (int x = 10; x + 40 < wall.width; x += 25 + random.Int(45)) {
      const int w = 12 + random.Int(16), top = random.Int(4) == 0 ? 2 : 14;
      for (int y = top; y < 32; ++y) {
        for (int i = x; i < x + w; ++i)
          wall.At(i, y) = Pack(i == x || i == x + w - 1 || y == 31 ? Rgb(235, 235, 230) : Rgb(62, 70, 84));
      }
    }
    scene->textures.push_back(std::make_shared<Texture>(std::move(wall)));
  }
}

// The lowest ground at the corners of a house.
double LowestCorner(const House& house, const Eigen::Vector3d& x, const Eigen::Vector3d& y, const HeightGrid& bare) {
  double low = 1e9;
  for (const double a : {-0.5, 0.5}) {
    for (const double b : {-0.5, 0.5}) {
      const Eigen::Vector3d corner = a * house.size_x * x + b * house.size_y * y;
      low = std::min(low, bare.Height(house.x + corner.x(), house.y + corner.y()));
    }
  }
  return low;
}

void AddHouses(const AerialLayout& layout, const HeightGrid& bare, Scene* scene) {
  const int first_roof = static_cast<int>(scene->textures.size()), first_wall = first_roof + kNumRoofs;
  AddRoofTextures(scene);
  AddWallTextures(scene);
  for (const House& house : layout.houses) {
    Random random(house.seed);
    const Eigen::Vector3d x(std::cos(house.yaw), std::sin(house.yaw), 0), y(-x.y(), x.x(), 0),
        up = Eigen::Vector3d::UnitZ();
    const double low = LowestCorner(house, x, y, bare);  // walls reach below the ground there
    const double eaves = bare.Height(house.x, house.y) + house.wall, bottom = std::min(low - 0.3, eaves - house.wall);
    const Eigen::Vector3d center(house.x, house.y, 0.5 * (eaves + bottom));
    Solid solid = MakeHouse(center, {house.size_x, house.size_y, eaves - bottom}, house.yaw, house.roof);
    const int roof = first_roof + random.Int(kNumRoofs), wall = first_wall + random.Int(kNumWalls);
    const auto shade = static_cast<float>(random.Uniform(0.85, 1.12));
    for (int f = 0; f < 6; ++f) {
      Face& face = solid.faces[f];
      const double scale = f < 4 ? kHouseWallScale : kRoofScale;
      const Eigen::Vector3d u = f < 2 ? y : x, v = f < 4 ? up : face.normal.cross(x).normalized();
      const double room_u = (f < 4 ? kWallTexels : kRoofTexels) / scale - house.size_x - 12;
      const double room_v = f < 4 ? 0 : kRoofTexels / scale - 2 * house.size_y - 12;
      const Eigen::Vector3d base(house.x, house.y, eaves);
      const double at_u = 6 + house.size_x / 2 + random.Uniform() * std::max(0.0, room_u);
      const double at_v = f < 4 ? 3 : 6 + house.size_y + random.Uniform() * std::max(0.0, room_v);
      LayTexture(&face, f < 4 ? wall : roof, base - at_u * u - at_v * v, u, v, scale);
      const auto light = static_cast<float>(Shading(face.normal, 1)) * shade;
      face.color = Color{light, light, light, 1};
    }
    scene->solids.push_back(std::move(solid));
  }
}

void CopyTwin(const AerialOptions& options, const HeightGrid& bare, Image* ground, HeightGrid* grid) {
  const Twin& twin = options.twin;
  const auto steps = [](double length, double step) { return static_cast<int>(std::lround(length / step)); };
  const auto corner = [&](double x, double y, double step) {
    return std::pair(steps(x - options.x0, step), steps(y - options.y0, step));
  };
  {
    const auto [from_i, from_j] = corner(twin.from_x, twin.from_y, options.texel);
    const auto [to_i, to_j] = corner(twin.to_x, twin.to_y, options.texel);
    const int n = steps(twin.size, options.texel);
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) ground->At(to_i + i, to_j + j) = ground->At(from_i + i, from_j + j);
    }
  }
  const auto [from_i, from_j] = corner(twin.from_x, twin.from_y, options.spacing);
  const auto [to_i, to_j] = corner(twin.to_x, twin.to_y, options.spacing);
  const int n = steps(twin.size, options.spacing);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const float plants = grid->At(from_i + i, from_j + j) - bare.At(from_i + i, from_j + j);
      grid->At(to_i + i, to_j + j) = bare.At(to_i + i, to_j + j) + plants;
    }
  }
}

void AddCars(const AerialLayout& layout, const HeightGrid& bare, Scene* scene) {
  const Color paints[] = {Rgb(235, 235, 238), Rgb(40, 42, 46),  Rgb(150, 152, 158), Rgb(95, 100, 108),
                          Rgb(140, 32, 36),   Rgb(40, 66, 120), Rgb(200, 196, 186)};
  for (const Car& car : layout.cars) {
    Random random(car.seed);
    const Color paint = paints[random.Int(7)];
    const double ground = bare.Height(car.x, car.y), length = random.Uniform(4.1, 4.9);
    Solid body = MakeBox({car.x, car.y, ground + 0.55}, {length, 1.8, 0.8}, car.yaw);
    Solid cabin = MakeBox({car.x - 0.25 * std::cos(car.yaw), car.y - 0.25 * std::sin(car.yaw), ground + 1.2},
                          {0.5 * length, 1.6, 0.5}, car.yaw);
    for (Face& face : body.faces) face.color = paint * static_cast<float>(Shading(face.normal, 1));
    for (Face& face : cabin.faces)
      face.color = (face.normal.z() > 0.5 ? paint : Rgb(50, 56, 64)) * static_cast<float>(Shading(face.normal, 1));
    scene->solids.push_back(std::move(body));
    scene->solids.push_back(std::move(cabin));
  }
}

}  // namespace

std::unique_ptr<Scene> BuildAerialScene(const AerialOptions& options, const MaterialLibrary& materials) {
  const AerialLayout layout(options);
  auto scene = std::make_unique<Scene>();
  HeightGrid bare;
  scene->grid = MakeHeights(layout, &bare);
  const auto light = MakeLight(layout, scene->grid, options.num_threads);
  Image ground(static_cast<int>(options.width / options.texel), static_cast<int>(options.length / options.texel));
  const HeightGrid& grid = scene->grid;
  ParallelFor(ground.height, 64, options.num_threads, [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < ground.width; ++i) {
        ground.At(i, j) = Pack(GroundCover(layout, materials, options.x0 + (i + 0.5) * options.texel,
                                           options.y0 + (j + 0.5) * options.texel));
      }
    }
    PaintPads(layout, materials, begin, end, &ground);
    PaintTrees(layout, materials, begin, end, &ground);
    for (int j = begin; j < end; ++j) {
      const double gy = std::min((j + 0.5) * options.texel / grid.spacing, grid.height - 1.001);
      const int row = static_cast<int>(gy);
      const auto fy = static_cast<float>(gy - row);
      for (int i = 0; i < ground.width; ++i) {
        const double gx = std::min((i + 0.5) * options.texel / grid.spacing, grid.width - 1.001);
        const int column = static_cast<int>(gx);
        const auto fx = static_cast<float>(gx - column);
        const float* l = light.data() + static_cast<size_t>(row) * grid.width + column;
        const float a = l[0] + (l[1] - l[0]) * fx, b = l[grid.width] + (l[grid.width + 1] - l[grid.width]) * fx;
        const uint32_t leaves = ground.At(i, j) & 0xff000000u;
        ground.At(i, j) = (Pack(Unpack(ground.At(i, j)) * (a + (b - a) * fy)) & 0xffffffu) | leaves;
      }
    }
  });
  if (options.twin.size > 0) CopyTwin(options, bare, &ground, &scene->grid);
  scene->ground = std::make_shared<Texture>(std::move(ground), options.num_threads);
  scene->ground_texels_per_metre = 1 / options.texel;
  // Detail below the texel size: the light and dark of grass.
  Image grey(256, 256);
  for (int y = 0; y < grey.height; ++y) {
    for (int x = 0; x < grey.width; ++x) {
      const Color c = materials.dry_lawn.At(x, y, 5);
      const float value = 128 + 2.f * (Luminance(c) - Luminance(materials.dry_lawn.Mean()));
      grey.At(x, y) = Pack(Color{value, value, value, 0});
    }
  }
  scene->detail = std::make_shared<Texture>(std::move(grey));
  scene->ground_detail = 0.5f;
  scene->continues = true;
  scene->foliage = static_cast<float>(options.foliage);
  scene->leaf_angle = options.leaf_angle;
  scene->leaf_time = options.leaf_time;
  scene->ground_repeat = options.repeat_x / options.texel;
  AddHouses(layout, bare, scene.get());
  AddCars(layout, bare, scene.get());
  scene->Build();
  return scene;
}

}  // namespace mapmend::simulate

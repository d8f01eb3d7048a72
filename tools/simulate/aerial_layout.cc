#include <array>

#include "tools/simulate/aerial.h"

namespace mapmend::simulate {
namespace {

constexpr double kBend = 16, kBendLength = 130;  // how far roads stray from straight lines, over which length; metres

}  // namespace

AerialLayout::AerialLayout(const AerialOptions& options) : options_(options) {
  const double s = options.road_spacing;
  const double width = options.repeat_x > 0 ? options.repeat_x : options.width;
  const auto block = [s](double v) { return static_cast<int64_t>(std::floor(v / s)); };
  for (int64_t j = block(options.y0 - kBend); j <= block(options.y0 + options.length + kBend); ++j) {
    for (int64_t i = block(options.x0 - kBend); i <= block(options.x0 + width + kBend); ++i) FillBlock(i, j);
  }
  if (options.repeat_x <= 0) return;
  // Objects of the first period, copied to the others.
  const auto repeat = [&](auto& list) {
    std::erase_if(list,
                  [&](const auto& item) { return item.x < options_.x0 || item.x >= options_.x0 + options_.repeat_x; });
    const size_t count = list.size();
    for (int k = 1; k * options_.repeat_x < options_.width; ++k) {
      for (size_t i = 0; i < count; ++i) {
        auto copy = list[i];
        copy.x += k * options_.repeat_x;
        list.push_back(copy);
      }
    }
  };
  repeat(trees);
  repeat(pads);
  repeat(houses);
  repeat(cars);
}

void AerialLayout::Warp(double x, double y, double* u, double* v) const {
  const uint64_t seed = Hash(options_.seed, 1);
  *u = x + kBend * ValueNoise(x / kBendLength, y / kBendLength, seed);
  *v = y + kBend * ValueNoise(x / kBendLength, y / kBendLength, seed + 1);
}

bool AerialLayout::ToWorld(double u, double v, double* x, double* y, double* yaw) const {
  *x = u;
  *y = v;
  double wu = 0, wv = 0;
  for (int i = 0; i < 12; ++i) {
    Warp(*x, *y, &wu, &wv);
    *x += u - wu;
    *y += v - wv;
  }
  double du = 0, dv = 0;
  Warp(*x + 1, *y, &du, &dv);
  *yaw = -std::atan2(dv - wv, du - wu);
  return *x >= options_.x0 && *y >= options_.y0 && *x <= options_.x0 + options_.width &&
         *y <= options_.y0 + options_.length;
}

Land AerialLayout::LandOf(int64_t i, int64_t j) const {
  const std::array<double, 5> shares = {options_.houses, options_.park, options_.fields, options_.marsh,
                                        options_.forest};
  double total = 0;
  for (const double share : shares) total += share;
  double pick = total * Unit(Hash(options_.seed, static_cast<uint64_t>(i) * 7919, static_cast<uint64_t>(j)));
  for (int k = 0; k < 5; ++k) {
    pick -= shares[k];
    if (pick < 0) return static_cast<Land>(k);
  }
  return Land::kPark;
}

AerialLayout::Place AerialLayout::At(double x, double y) const {
  if (options_.repeat_x > 0) x -= options_.repeat_x * std::floor((x - options_.x0) / options_.repeat_x);
  const double s = options_.road_spacing;
  Place place;
  Warp(x, y, &place.u, &place.v);
  place.block_x = static_cast<int64_t>(std::floor(place.u / s));
  place.block_y = static_cast<int64_t>(std::floor(place.v / s));
  const auto nearest = [s](double v) { return std::abs(v - s * std::floor(v / s + 0.5)); };
  const double du = nearest(place.u), dv = nearest(place.v);
  const auto road = [&](uint64_t direction, double v) {
    return Hash(options_.seed + 41, direction, static_cast<uint64_t>(static_cast<int64_t>(std::floor(v / s + 0.5))));
  };
  // Where two roads cross, one of them goes through.
  const uint64_t road_u = road(1, place.u), road_v = road(2, place.v);
  bool along_v = du < dv;
  if (std::max(du, dv) < 4.4) along_v = road_u < road_v ? du < 3.4 || du < dv : dv >= 3.4 && du < dv;
  place.road = along_v ? du : dv;
  place.along = along_v ? place.v : place.u;
  place.road_seed = along_v ? road_u : road_v;
  place.crossing = du < 7 && dv < 7;
  place.land = LandOf(place.block_x, place.block_y);
  place.seed = Hash(options_.seed, static_cast<uint64_t>(place.block_x), static_cast<uint64_t>(place.block_y));
  return place;
}

double AerialLayout::Hills(double x, double y) const {
  if (options_.repeat_x > 0) x -= options_.repeat_x * std::floor((x - options_.x0) / options_.repeat_x);
  return 0.5 * options_.relief * Fbm(x / 170, y / 170, 3, 0.35, Hash(options_.seed, 2));
}

double AerialLayout::LakeDistance(const Lake& lake, double x, double y) const {
  const double dx = x - lake.x, dy = y - lake.y, c = std::cos(lake.yaw), s = std::sin(lake.yaw);
  const double a = (c * dx + s * dy) / lake.radius_x, b = (-s * dx + c * dy) / lake.radius_y;
  return std::sqrt(a * a + b * b) + 0.12 * Fbm(x / 20, y / 20, 4, 0.55, Hash(options_.seed, 3));
}

bool AerialLayout::Free(double x, double y, double radius) const {
  for (const House& house : houses) {
    if (std::hypot(house.x - x, house.y - y) < radius + 0.6 * std::max(house.size_x, house.size_y)) return false;
  }
  for (const Pad& pad : pads) {
    if (pad.kind == Pad::Kind::kCourt && std::hypot(pad.x - x, pad.y - y) < radius + std::max(pad.half_x, pad.half_y))
      return false;
  }
  for (const Lake& lake : options_.lakes) {
    if (LakeDistance(lake, x, y) < 1.0 + radius / std::min(lake.radius_x, lake.radius_y)) return false;
  }
  return true;
}

void AerialLayout::AddTree(double u, double v, double radius, double height, uint64_t seed) {
  double x = 0, y = 0, yaw = 0;
  if (!ToWorld(u, v, &x, &y, &yaw)) return;
  const Place place = At(x, y);
  if (place.road < 6 + 0.5 * radius || !Free(x, y, 0.6 * radius)) return;
  trees.push_back({x, y, radius, height, seed});
}

void AerialLayout::FillBlock(int64_t i, int64_t j) {
  const uint64_t seed = Hash(options_.seed, static_cast<uint64_t>(i), static_cast<uint64_t>(j));
  const double s = options_.road_spacing, u0 = static_cast<double>(i) * s, v0 = static_cast<double>(j) * s;
  const Land land = LandOf(i, j);
  Random random(seed);
  if (land == Land::kHouses) FillHouses(i, j, seed);
  if (land == Land::kPark) FillPark(i, j, seed);
  const double area = s * s;
  const int count = static_cast<int>(options_.trees * area *
                                     (land == Land::kForest   ? 0.014
                                      : land == Land::kFields ? 0.0006
                                      : land == Land::kHouses ? 0.0022
                                                              : 0.0014));
  for (int k = 0; k < count; ++k) {
    const double u = u0 + random.Uniform(7, s - 7), v = v0 + random.Uniform(7, s - 7);
    const double radius = random.Uniform(1.2, land == Land::kForest ? 4.0 : 4.6);
    AddTree(u, v, radius, radius * random.Uniform(1.3, 2.0), random.Next());
  }
  // Hedgerows and avenues along the edge of a block.
  for (int side = 0; side < 4; ++side) {
    if (random.Uniform() > 0.3 || land == Land::kHouses) continue;
    const double step = random.Uniform(3.5, 9), radius = random.Uniform(1.2, 2.6);
    for (double along = 10; along < s - 10; along += step * random.Uniform(0.9, 1.1)) {
      const double across = 9 + random.Uniform(-0.4, 0.4);
      const double u = side == 0 ? along : side == 1 ? s - across : side == 2 ? along : across;
      const double v = side == 0 ? across : side == 1 ? along : side == 2 ? s - across : along;
      AddTree(u0 + u, v0 + v, radius * random.Uniform(0.85, 1.15), 2 * radius, random.Next());
    }
  }
}

// Two rows of lots along the roads of a block, back to back.
void AerialLayout::FillHouses(int64_t i, int64_t j, uint64_t seed) {
  const double s = options_.road_spacing, u0 = static_cast<double>(i) * s, v0 = static_cast<double>(j) * s;
  Random random(seed + 1);
  const double depth = (s - 16) / 2;
  for (int side = 0; side < 2; ++side) {
    const double inward = side == 0 ? 1 : -1, front = side == 0 ? v0 + 8 : v0 + s - 8;
    for (double u = u0 + 10; u < u0 + s - 18;) {
      const double lot = random.Uniform(15, 22), middle = u + lot / 2;
      u += lot;
      double x = 0, y = 0, yaw = 0;
      const auto pad = [&](Pad::Kind kind, double pu, double pv, double half_u, double half_v) {
        double px = 0, py = 0, pyaw = 0;
        const uint64_t pad_seed = random.Next();
        if (ToWorld(pu, pv, &px, &py, &pyaw)) pads.push_back({kind, px, py, half_u, half_v, pyaw, pad_seed});
      };
      pad(Pad::Kind::kYard, middle, front + inward * depth / 2, lot / 2, depth / 2);
      pad(Pad::Kind::kFence, middle + lot / 2, front + inward * (0.5 * depth + 6), 0.1, depth / 2 - 6);
      const double set_back = random.Uniform(8, 12);
      House house{0,
                  0,
                  random.Uniform(10, lot - 3),
                  random.Uniform(8, 11),
                  random.Uniform(2.8, 3.4),
                  random.Uniform(1.4, 2.6),
                  0,
                  random.Next()};
      if (random.Uniform() < 0.12) house.wall += 2.8;
      const double hv = front + inward * (set_back + house.size_y / 2);
      if (!ToWorld(middle, hv, &x, &y, &yaw) || !Free(x, y, 4)) continue;
      house.x = x, house.y = y, house.yaw = yaw;
      houses.push_back(house);
      if (random.Uniform() < 0.4) {  // a wing across
        House wing = house;
        double wx = 0, wy = 0, wyaw = 0;
        wing.size_x = house.size_y * random.Uniform(0.9, 1.2);
        wing.size_y = random.Uniform(5, 7);
        wing.roof = house.roof * 0.8;
        if (ToWorld(middle + house.size_x * 0.25, hv - inward * house.size_y * 0.4, &wx, &wy, &wyaw)) {
          wing.x = wx, wing.y = wy, wing.yaw = wyaw + 1.5707963267948966;
          houses.push_back(wing);
        }
      }
      pad(Pad::Kind::kDriveway, middle - lot * 0.28, front + inward * (set_back - 2) / 2, random.Uniform(1.6, 2.8),
          (set_back + 2) / 2);
      if (random.Uniform() < 0.35)
        pad(Pad::Kind::kPool, middle + random.Uniform(-2, 2), hv + inward * (house.size_y / 2 + 5), 3.6, 2.4);
      for (int car = random.Int(3); car > 0; --car) {
        const double cu = middle - lot * 0.28 + (car - 1) * 2.6,
                     cv = front + inward * random.Uniform(1.5, set_back - 3);
        if (ToWorld(cu, cv, &x, &y, &yaw)) cars.push_back({x, y, yaw + 1.5707963267948966, random.Next()});
      }
      for (int tree = random.Int(3); tree > 0; --tree) {
        const double radius = random.Uniform(1.5, 4.5);
        AddTree(middle + random.Uniform(-lot / 2, lot / 2), front + inward * random.Uniform(2, depth), radius,
                1.7 * radius, random.Next());
      }
    }
  }
}

void AerialLayout::FillPark(int64_t i, int64_t j, uint64_t seed) {
  const double s = options_.road_spacing, u0 = static_cast<double>(i) * s, v0 = static_cast<double>(j) * s;
  Random random(seed + 2);
  const int courts = random.Int(3);
  for (int k = 0; k < courts; ++k) {
    double x = 0, y = 0, yaw = 0;
    const bool wide = random.Uniform() < 0.5;
    if (ToWorld(u0 + random.Uniform(24, s - 24), v0 + random.Uniform(24, s - 24), &x, &y, &yaw)) {
      pads.push_back({Pad::Kind::kCourt, x, y, wide ? 17.0 : 9.0, wide ? 9.0 : 15.0, yaw, random.Next()});
    }
  }
  for (int k = 0; k < 2; ++k) {
    double x = 0, y = 0, yaw = 0;
    if (ToWorld(u0 + random.Uniform(20, s - 20), v0 + s / 2, &x, &y, &yaw)) {
      pads.push_back({Pad::Kind::kPath, x, y, 0.9, s / 2 - 5, yaw, random.Next()});
    }
  }
}

}  // namespace mapmend::simulate

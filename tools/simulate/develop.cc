// From light to a finished picture: motion blur, exposure, sharpening, noise.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "tools/simulate/random.h"
#include "tools/simulate/renderer.h"

namespace mapmend::simulate {
namespace {

// Noise of one pixel, by table: sums of uniform numbers, of unit variance.
const std::array<Color, RowKernels::kNoises>& NoiseTable() {
  static const auto table = [] {
    std::array<Color, RowKernels::kNoises> values;
    Random random(77);
    for (Color& v : values) {
      v = Color{};
      for (int c = 0; c < 3; ++c) v[c] = static_cast<float>(random.Gaussian());
    }
    return values;
  }();
  return table;
}

}  // namespace

void Renderer::Project(const Motion& motion, const float* p, float* u, float* v) const {
  const float* r = motion.rotation;
  const float z = r[6] * p[0] + r[7] * p[1] + r[8] * p[2] + motion.translation[2];
  const float inverse = 1.f / std::max(z, 1e-3f);
  const float x = (r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + motion.translation[0]) * inverse;
  const float y = (r[3] * p[0] + r[4] * p[1] + r[5] * p[2] + motion.translation[1]) * inverse;
  const Eigen::Vector2d pixel = camera_.Project(Eigen::Vector3d(x, y, 1));
  *u = static_cast<float>(pixel.x());
  *v = static_cast<float>(pixel.y());
}

void Renderer::MoveCorners(int y0, int y1, const CornerPoints& points, Color* moved) const {
  if (camera_.model == Camera::Model::kPinhole) {
    RowKernels::Get().move_corners(corner_motions_[y0 / kTile], lens_, points, moved);
    return;
  }
  for (int k = 0; k < 8; ++k) {
    const RowPose& row = rows_[k % 2 == 0 ? y0 : y1];
    const float d = points.distance[k], point[3] = {points.x[k] * d, points.y[k] * d, points.z[k] * d};
    float a, b, c, e;
    Project(row.begin, point, &a, &b);
    Project(row.end, point, &c, &e);
    moved[k] = Color{a, b, c, e} - Color{points.pixel_x[k], points.pixel_y[k], points.pixel_x[k], points.pixel_y[k]};
  }
}

bool Renderer::FindMotion(int tile, bool plain) {
  if (!options_.motion_blur || options_.exposure <= 0) return true;
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const int x0 = tile % tiles * kTile, y0 = tile / tiles * kTile;
  const int x1 = std::min(x0 + kTile, width) - 1, y1 = std::min(y0 + kTile, camera_.height) - 1;
  float nearest = 1e5f, farthest = 0;
  // A plane is nearest and farthest at corners.
  if (plain || x1 - x0 != kTile - 1) {
    for (int y = y0; y <= y1; y += plain ? std::max(1, y1 - y0) : 1) {
      for (int x = x0; x <= x1; x += plain ? std::max(1, x1 - x0) : 1) {
        const float distance = std::min(distance_[static_cast<size_t>(y) * width + x], 1e5f);
        nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
      }
    }
  } else {
    Color low = Color{} + 1e5f, high = {};
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; x += 4) {
        Color distance;
        std::memcpy(&distance, &distance_[static_cast<size_t>(y) * width + x], sizeof distance);
        low = distance < low ? distance : low;
        high = distance > high ? distance : high;
      }
    }
    for (int k = 0; k < 4; ++k) nearest = std::min(nearest, low[k]), farthest = std::max(farthest, high[k]);
    farthest = std::min(farthest, 1e5f);
  }
  // The motion of a pixel is nearly linear in inverse distance: exactly so but for moving towards the surface.
  TileMotion& motion = motions_[tile];
  const float between = 0.75f / nearest;
  motion.least = 1.f / farthest, motion.greatest = 1.f / nearest;
  bool still = true;
  CornerPoints points;
  for (int k = 0; k < 8; ++k) {
    const int x = k % 4 < 2 ? x0 : x1, y = k % 2 == 0 ? y0 : y1;
    const Eigen::Vector3f& ray = rays_[static_cast<size_t>(y) * width + x];
    points.x[k] = ray.x(), points.y[k] = ray.y(), points.z[k] = ray.z();
    points.distance[k] = k < 4 ? nearest : std::min(4 * nearest, 1e5f);
    points.pixel_x[k] = static_cast<float>(x), points.pixel_y[k] = static_cast<float>(y);
  }
  Color moved[8];
  MoveCorners(y0, y1, points, moved);
  for (int k = 0; k < 4; ++k) {
    const Color &near = moved[k], &far = moved[k + 4];
    motion.slope[k] = (near - far) * (1.f / between);
    motion.base[k] = near - motion.slope[k] * (1.f / nearest);
    const auto moves = [](const Color& m) {
      return (m[2] - m[0]) * (m[2] - m[0]) + (m[3] - m[1]) * (m[3] - m[1]) > 0.24f;
    };
    still &= !moves(near) && !moves(motion.base[k] + motion.slope[k] * (1.f / farthest));
  }
  return still;
}

bool Renderer::IsEven(const Color& least, const Color& most, int x, int y) const {
  constexpr float kUneven = 0.3f;
  for (int k = 0; k < 4; ++k) {
    if (most[k] - least[k] > kUneven) return false;
    const auto at = static_cast<float>(k % 2 == 0 ? x : y);
    const auto size = static_cast<float>(k % 2 == 0 ? camera_.width - kTile : camera_.height);
    // What lies that far the other way is read, and one more.
    if (at - most[k] < 1 || at - least[k] > size - 3) return false;
  }
  return true;
}

void Renderer::BlurRow(int y, int begin, int end, Color* blurred) const {
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const size_t row = static_cast<size_t>(y) * width;
  const int y0 = y / kTile * kTile, y1 = std::min(y0 + kTile, camera_.height) - 1;
  const RowKernels& kernels = RowKernels::Get();
  const float down = y1 > y0 ? static_cast<float>(y - y0) / static_cast<float>(y1 - y0) : 0;
  for (int x = begin; x < end; x += kTile) {
    const int tile = y / kTile * tiles + x / kTile, count = std::min(kTile, width - x);
    const auto sharp = [&] {
      for (int k = 0; k < count; ++k) blurred[x + k] = UnpackLight(light_[row + x + k]);
    };
    if (tiles_[tile].still) {
      sharp();
      continue;
    }
    const TileMotion& m = motions_[tile];
    const float across = count > 1 ? 1.f / static_cast<float>(count - 1) : 0.f;
    const auto line = [&](const Color* corners, Color* start, Color* step) {
      *start = corners[0] + (corners[1] - corners[0]) * down;
      *step = (corners[2] + (corners[3] - corners[2]) * down - *start) * across;
    };
    RowMotion motion;
    line(m.base, &motion.base, &motion.base_step);
    line(m.slope, &motion.slope, &motion.slope_step);
    const Color slow = motion.base + motion.slope * m.least, fast = motion.base + motion.slope * m.greatest;
    const float last = static_cast<float>(count - 1);
    const Color slow_end = slow + (motion.base_step + motion.slope_step * m.least) * last,
                fast_end = fast + (motion.base_step + motion.slope_step * m.greatest) * last;
    const auto low = [](const Color& a, const Color& b) { return a < b ? a : b; };
    const auto high = [](const Color& a, const Color& b) { return a < b ? b : a; };
    const Color least = low(low(slow, slow_end), low(fast, fast_end)),
                most = high(high(slow, slow_end), high(fast, fast_end));
    if (count == kTile && IsEven(least, most, x, y)) {
      const Color offset = (least + most) * 0.5f;
      const float dx = offset[2] - offset[0], dy = offset[3] - offset[1];
      if (dx * dx + dy * dy < 0.25f) {
        sharp();
        continue;
      }
      kernels.blur_even(light_.data(), width, x, y, offset, blurred + x);
      continue;
    }
    kernels.blur(light_.data(), width, camera_.height, x, y, count, distance_.data() + row + x, motion, blurred + x);
  }
}

void Renderer::DevelopRows(int begin, int end, const SensorState& sensor, Frame* frame) const {
  const int width = camera_.width, height = camera_.height;
  const auto& table = NoiseTable();
  const RowKernels& kernels = RowKernels::Get();
  const float cx = static_cast<float>(width) / 2, cy = static_cast<float>(height) / 2;
  const Exposure exposure{Rgb(sensor.gain[0], sensor.gain[1], sensor.gain[2]),
                          Rgb(168 * 168, 161 * 161, 166 * 166) * options_.haze, 1.f - options_.haze,
                          sensor.vignetting / (cx * cx + cy * cy)};
  // Three rows of values, used in turn, and what sharpening needs.
  const auto size = static_cast<size_t>(width);
  std::vector<Color> buffer(5 * size + 2);
  Color* lines[3] = {buffer.data(), buffer.data() + size, buffer.data() + 2 * size};
  Color *sharp = buffer.data() + 3 * size, *sums = sharp + size;
  const auto fill = [&](int y, Color* line) {
    y = std::clamp(y, 0, height - 1);
    constexpr int kPiece = 16 * kTile;  // stays in the nearest cache
    for (int x = 0; x < width; x += kPiece) {
      const int last = std::min(x + kPiece, width);
      BlurRow(y, x, last, line);
      kernels.expose(exposure, static_cast<float>(x) - cx, static_cast<float>(y) - cy, last - x, line + x);
    }
  };
  const auto amount = static_cast<float>(options_.sharpening);
  const bool sharpen = amount > 0;
  if (sharpen) {
    fill(begin - 1, lines[0]);
    fill(begin, lines[1]);
  }
  for (int y = begin; y < end; ++y) {
    if (sharpen) {
      fill(y + 1, lines[2]);
      kernels.sharpen(lines, width, amount, sums, sharp);
    } else {
      fill(y, sharp);
    }
    // Photon noise is constant after the square root, so one figure serves for bright and dark.
    kernels.store(sharp, width, table.data(), sensor.noise, Hash(sensor.seed, static_cast<uint64_t>(y)),
                  frame->bgr.data() + static_cast<size_t>(y) * width * 3);
    if (sharpen) std::rotate(lines, lines + 1, lines + 3);
  }
}

}  // namespace mapmend::simulate

// From light to a finished picture: motion blur, exposure, sharpening, noise.
#include <array>
#include <cmath>

#include "procs/simulate/random.h"
#include "procs/simulate/renderer.h"

namespace mapmend::simulate {
namespace {

// Noise of one pixel, by table: sums of uniform numbers, of unit variance.
constexpr uint64_t kNoises = 1024;
const std::array<Color, kNoises>& NoiseTable() {
  static const auto table = [] {
    std::array<Color, kNoises> values;
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
  if (!distorted_) {
    *u = static_cast<float>(camera_.fx) * x + static_cast<float>(camera_.cx);
    *v = static_cast<float>(camera_.fy) * y + static_cast<float>(camera_.cy);
    return;
  }
  if (camera_.model == Camera::Model::kPinhole) {
    float d[5];
    for (int k = 0; k < 5; ++k) d[k] = static_cast<float>(camera_.distortion[k]);
    const float r2 = x * x + y * y, radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    const float xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
    const float yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
    *u = static_cast<float>(camera_.fx) * xd + static_cast<float>(camera_.cx);
    *v = static_cast<float>(camera_.fy) * yd + static_cast<float>(camera_.cy);
    return;
  }
  const Eigen::Vector2d pixel = camera_.Project(Eigen::Vector3d(x, y, 1));
  *u = static_cast<float>(pixel.x());
  *v = static_cast<float>(pixel.y());
}

Color Renderer::MotionOf(int x, int y, float distance) const {
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  distance = std::min(distance, 1e5f);
  const float point[3] = {rays_[i].x() * distance, rays_[i].y() * distance, rays_[i].z() * distance};
  float x0, y0, x1, y1;
  Project(rows_[y].begin, point, &x0, &y0);
  Project(rows_[y].end, point, &x1, &y1);
  const float fx = static_cast<float>(x), fy = static_cast<float>(y);
  return Color{x0 - fx, y0 - fy, x1 - fx, y1 - fy};
}

bool Renderer::FindMotion(int tile, bool plain) {
  if (!options_.motion_blur || options_.exposure <= 0) return true;
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const int x0 = tile % tiles * kTile, y0 = tile / tiles * kTile;
  const int x1 = std::min(x0 + kTile, width) - 1, y1 = std::min(y0 + kTile, camera_.height) - 1;
  float nearest = 1e5f, farthest = 0;
  // A plane is nearest and farthest at corners.
  for (int y = y0; y <= y1; y += plain ? std::max(1, y1 - y0) : 1) {
    for (int x = x0; x <= x1; x += plain ? std::max(1, x1 - x0) : 1) {
      const float distance = std::min(distance_[static_cast<size_t>(y) * width + x], 1e5f);
      nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
    }
  }
  // The motion of a pixel is nearly linear in inverse distance: exactly so but for moving towards the surface.
  TileMotion& motion = motions_[tile];
  const float between = 0.75f / nearest;
  motion.least = 1.f / farthest, motion.greatest = 1.f / nearest;
  bool still = true;
  for (int k = 0; k < 4; ++k) {
    const int x = k < 2 ? x0 : x1, y = k % 2 == 0 ? y0 : y1;
    const Color near = MotionOf(x, y, nearest), far = MotionOf(x, y, 4 * nearest);
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

void Renderer::ExposeRow(int y, int begin, int end, const SensorState& sensor, Color* row) const {
  const int width = camera_.width;
  const float cx = static_cast<float>(width) / 2, cy = static_cast<float>(camera_.height) / 2;
  const float falloff = sensor.vignetting / (cx * cx + cy * cy);
  const float dy = static_cast<float>(y) - cy;
  const Color gain = Rgb(sensor.gain[0], sensor.gain[1], sensor.gain[2]);
  const Color haze = Rgb(168 * 168, 161 * 161, 166 * 166) * options_.haze;
  const float clear = 1.f - options_.haze;
  for (int x = begin; x < end; ++x) {
    const float dx = static_cast<float>(x) - cx;
    const Color value = (row[x] * clear + haze) * (gain * (1.f - falloff * (dx * dx + dy * dy)));
    row[x] = SquareRoot(value);
  }
}

void Renderer::DevelopRows(int begin, int end, const SensorState& sensor, Frame* frame) const {
  const int width = camera_.width, height = camera_.height;
  const auto& table = NoiseTable();
  // Three rows of stored values, used in turn.
  std::vector<Color> buffer(3 * static_cast<size_t>(width));
  Color* lines[3] = {buffer.data(), buffer.data() + width, buffer.data() + 2 * static_cast<size_t>(width)};
  const auto fill = [&](int y, Color* line) {
    y = std::clamp(y, 0, height - 1);
    constexpr int kPiece = 16 * kTile;  // stays in the nearest cache
    for (int x = 0; x < width; x += kPiece) {
      BlurRow(y, x, std::min(x + kPiece, width), line);
      ExposeRow(y, x, std::min(x + kPiece, width), sensor, line);
    }
  };
  const auto amount = static_cast<float>(options_.sharpening);
  const bool sharpen = amount > 0;
  if (sharpen) {
    fill(begin - 1, lines[0]);
    fill(begin, lines[1]);
  }
  for (int y = begin; y < end; ++y) {
    if (sharpen)
      fill(y + 1, lines[2]);
    else
      fill(y, lines[1]);
    const uint64_t row_seed = Hash(sensor.seed, static_cast<uint64_t>(y));
    uint64_t random = 0;
    uint8_t* out = frame->bgr.data() + static_cast<size_t>(y) * width * 3;
    for (int x = 0; x < width; ++x, out += 3) {
      Color value = lines[1][x];
      if (sharpen) {
        const int left = std::max(x - 1, 0), right = std::min(x + 1, width - 1);
        const auto column = [&](int c) { return lines[0][c] + lines[1][c] + lines[2][c]; };
        value += (value - (column(left) + column(x) + column(right)) * (1.f / 9)) * amount;
      }
      if (x % 4 == 0) random = Hash(row_seed + static_cast<uint64_t>(x));
      // Photon noise is constant after the square root, so one figure serves for bright and dark.
      value += table[random & (kNoises - 1)] * sensor.noise + 0.5f;
      random >>= 16;
      const uint32_t stored = PackTruncated(value);
      out[0] = static_cast<uint8_t>(stored >> 16), out[1] = static_cast<uint8_t>(stored >> 8),
      out[2] = static_cast<uint8_t>(stored);
    }
    if (sharpen) std::rotate(lines, lines + 1, lines + 3);
  }
}

}  // namespace mapmend::simulate

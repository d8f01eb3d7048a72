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

bool Renderer::IsStill(int x0, int y0, int x_end, int y_end, bool plain) const {
  if (!options_.motion_blur || options_.exposure <= 0) return true;
  const auto moves = [this](int x, int y, float distance) {
    const Color m = MotionOf(x, y, distance);
    return (m[2] - m[0]) * (m[2] - m[0]) + (m[3] - m[1]) * (m[3] - m[1]) > 0.24f;
  };
  float nearest = 1e5f, farthest = 0;
  for (int y = y0; y < y_end && !plain; ++y) {
    for (int x = x0; x < x_end; ++x) {
      const float distance = std::min(distance_[static_cast<size_t>(y) * camera_.width + x], 1e5f);
      nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
    }
  }
  for (const int y : {y0, y_end - 1}) {
    for (const int x : {x0, x_end - 1}) {
      if (plain ? moves(x, y, distance_[static_cast<size_t>(y) * camera_.width + x])
                : moves(x, y, nearest) || moves(x, y, farthest))
        return false;
    }
  }
  return true;
}

void Renderer::BlurRow(int y, int begin, int end, Color* blurred) const {
  const int width = camera_.width, height = camera_.height;
  const size_t row = static_cast<size_t>(y) * width;
  if (!options_.motion_blur || options_.exposure <= 0) {
    for (int x = begin; x < end; ++x) blurred[x] = UnpackLight(light_[row + x]);
    return;
  }
  const TileState* tiles = tiles_.data() + static_cast<size_t>(y / kTile) * ((width + kTile - 1) / kTile);
  const float right = static_cast<float>(width - 1) - 0.001f, bottom = static_cast<float>(height - 1) - 0.001f;
  const Color limit = {right, bottom, right, bottom};
  Color tile_motion = {}, tile_step = {};
  for (int x = begin; x < end; ++x) {
    const size_t i = row + x;
    const float fx = static_cast<float>(x), fy = static_cast<float>(y);
    Color offset;
    if (tiles[x / kTile].still) {
      for (const int tile_end = std::min(x + kTile, width); x < tile_end; ++x)
        blurred[x] = UnpackLight(light_[row + x]);
      --x;
      continue;
    }
    if (!tiles[x / kTile].plain) {
      offset = MotionOf(x, y);
    } else {
      if (x % kTile == 0) {
        const int last = std::min(x + kTile, width) - 1;
        tile_motion = MotionOf(x, y);
        const Color last_motion = MotionOf(last, y);
        tile_step = last > x ? (last_motion - tile_motion) * (1.f / static_cast<float>(last - x)) : Color{};
      }
      offset = tile_motion + tile_step * static_cast<float>(x % kTile);
    }
    const float dx = offset[2] - offset[0], dy = offset[3] - offset[1];
    const float length = std::sqrt(dx * dx + dy * dy);
    if (length < 0.5f) {
      blurred[x] = UnpackLight(light_[i]);
      continue;
    }
    // What passes over this pixel a part s of half the exposure before the middle lies, in the middle, at minus its
    // motion.
    const int half = std::clamp(static_cast<int>(length * 0.5f + 0.5f), 1, 24);
    const float step = 1.f / (static_cast<float>(half) + 0.5f);
    Color sum = UnpackLight(light_[i]);
    const auto add = [&](int ix, int iy, float ax, float ay) {
      const Light* p = light_.data() + static_cast<size_t>(iy) * width + ix;
      const Color a = UnpackLight(p[0]), b = UnpackLight(p[1]), c = UnpackLight(p[width]),
                  d = UnpackLight(p[width + 1]);
      const Color above = a + (b - a) * ax, below = c + (d - c) * ax;
      sum += above + (below - above) * ay;
    };
    const Color here = {fx, fy, fx, fy};
    for (int k = 1; k <= half; ++k) {
      Color from = here - offset * (static_cast<float>(k) * step);
      from = from > 0.f ? from : Color{};
      from = from < limit ? from : limit;
      const Int4 whole = __builtin_convertvector(from, Int4);
      const Color part = from - __builtin_convertvector(whole, Color);
      add(whole[0], whole[1], part[0], part[1]);
      add(whole[2], whole[3], part[2], part[3]);
    }
    blurred[x] = sum * (1.f / static_cast<float>(2 * half + 1));
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

#include "procs/simulate/renderer.h"

#include <array>
#include <cmath>

#include "procs/simulate/parallel.h"
#include "procs/simulate/random.h"

namespace mapmend::simulate {
namespace {

// Ray (z = 1) of a distorted pixel: Newton's method on Camera::Project.
Eigen::Vector3d Unproject(const Camera& camera, const Eigen::Vector2d& pixel) {
  Eigen::Vector2d p((pixel.x() - camera.cx) / camera.fx, (pixel.y() - camera.cy) / camera.fy);
  if (!camera.HasDistortion()) return {p.x(), p.y(), 1};
  if (camera.model == Camera::Model::kFisheye) {
    // Begin at the equidistant solution, which is near; the plane z = 1 is far from linear in the angle.
    const double angle = std::min(p.norm(), 1.5);
    if (angle > 1e-9) p *= std::tan(angle) / p.norm();
  }
  const auto at = [&](double x, double y) { return camera.Project(Eigen::Vector3d(x, y, 1)); };
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d error = at(p.x(), p.y()) - pixel;
    if (error.squaredNorm() < 1e-16) break;
    const double h = 1e-6 * (1 + p.norm());
    Eigen::Matrix2d jacobian;
    jacobian.col(0) = (at(p.x() + h, p.y()) - at(p.x() - h, p.y())) / (2 * h);
    jacobian.col(1) = (at(p.x(), p.y() + h) - at(p.x(), p.y() - h)) / (2 * h);
    p -= jacobian.inverse() * error;
  }
  return {p.x(), p.y(), 1};
}

constexpr int kTile = 8;

// Gaussian numbers by table: a sum of uniforms, scaled to unit variance.
const std::array<float, 4096>& GaussianTable() {
  static const auto table = [] {
    std::array<float, 4096> values;
    Random random(77);
    for (float& v : values) v = static_cast<float>(random.Gaussian());
    return values;
  }();
  return table;
}

}  // namespace

Renderer::Renderer(const Scene* scene, const Camera& camera, const RenderOptions& options)
    : scene_(scene), camera_(camera), options_(options) {
  const size_t size = static_cast<size_t>(camera.width) * camera.height;
  rays_.resize(size);
  ParallelFor(camera.height, 16, options.num_threads, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        rays_[static_cast<size_t>(y) * camera.width + x] = Unproject(camera, Eigen::Vector2d(x, y)).normalized().cast<float>();
      }
    }
  });
  pixel_angle_ = std::exp2(options.lod_bias) / std::sqrt(camera.fx * camera.fy);
  rows_.resize(camera.height);
  distance_.resize(size);
  surface_.resize(size);
  plain_.resize(static_cast<size_t>((camera.width + kTile - 1) / kTile) * ((camera.height + kTile - 1) / kTile));
  sharp_.resize(size);
  smooth_.resize(size);
  blurred_.resize(size);
}

Eigen::Vector3d Renderer::Ray(int x, int y) const {
  return rays_[static_cast<size_t>(y) * camera_.width + x].cast<double>().normalized();
}

void Renderer::Render(const PoseFunction& pose, double time, const SensorState& sensor, Frame* frame) {
  const int width = camera_.width, height = camera_.height;
  const auto relative = [](const Rigid3& cam_from_mid) {
    Motion motion;
    const Eigen::Matrix3f rotation = cam_from_mid.rotation.toRotationMatrix().cast<float>();
    for (int i = 0; i < 9; ++i) motion.rotation[i] = rotation(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) motion.translation[i] = static_cast<float>(cam_from_mid.translation[i]);
    return motion;
  };
  ParallelFor(height, 32, options_.num_threads, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      if (y > begin && options_.readout == 0) {
        rows_[y] = rows_[begin];
        continue;
      }
      const double row_time = time + (static_cast<double>(y) / (height - 1) - 0.5) * options_.readout;
      const Rigid3 world_from_mid = pose(row_time);
      rows_[y].rotation = world_from_mid.rotation.toRotationMatrix();
      rows_[y].center = world_from_mid.translation;
      rows_[y].begin = relative(pose(row_time - options_.exposure / 2).Inverse() * world_from_mid);
      rows_[y].end = relative(pose(row_time + options_.exposure / 2).Inverse() * world_from_mid);
    }
  });
  frame->width = width;
  frame->height = height;
  frame->bgr.resize(static_cast<size_t>(width) * height * 3);
  const auto rows = [&](auto&& body) {
    ParallelFor(height, 8, options_.num_threads, [&](int begin, int end) {
      for (int y = begin; y < end; ++y) body(y);
    });
  };
  ParallelFor((height + kTile - 1) / kTile, 1, options_.num_threads, [&](int begin, int end) {
    for (int tile_row = begin; tile_row < end; ++tile_row) CastTiles(tile_row);
  });
  rows([&](int y) { SmoothEdges(y); });
  rows([&](int y) {
    BlurRow(y);
    DevelopRow(y, sensor, frame);
  });
}

void Renderer::CastPixel(int x, int y) {
  const RowPose& row = rows_[y];
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  const Eigen::Vector3d direction = row.rotation * rays_[i].cast<double>();
  const Hit hit = scene_->Cast(row.center, direction);
  distance_[i] = static_cast<float>(hit.distance);
  surface_[i] = hit.surface;
  const Color color = scene_->Shade(row.center, direction, hit, pixel_angle_);
  sharp_[i] = color * color;
}

void Renderer::CastTiles(int tile_row) {
  const int width = camera_.width, y0 = tile_row * kTile, y1 = std::min(y0 + kTile, camera_.height - 1);
  const int tiles = (width + kTile - 1) / kTile;
  std::vector<Hit> corners(2 * static_cast<size_t>(tiles + 1));
  for (int k = 0; k <= tiles; ++k) {
    const int x = std::min(k * kTile, width - 1);
    int side = 0;
    for (const int y : {y0, y1}) {
      const Eigen::Vector3d direction = rows_[y].rotation * rays_[static_cast<size_t>(y) * width + x].cast<double>();
      corners[2 * static_cast<size_t>(k) + side++] = scene_->Cast(rows_[y].center, direction);
    }
  }
  for (int k = 0; k < tiles; ++k) {
    const int x0 = k * kTile, x1 = std::min(x0 + kTile, width - 1);
    const bool plain = FillPlainTile(x0, y0, x1, y1, corners.data() + 2 * static_cast<size_t>(k));
    plain_[static_cast<size_t>(tile_row) * tiles + k] = plain;
    if (plain) continue;
    for (int y = y0; y < std::min(y0 + kTile, camera_.height); ++y) {
      for (int x = x0; x < std::min(x0 + kTile, width); ++x) CastPixel(x, y);
    }
  }
}

// hits: upper left, lower left, upper right, lower right.
bool Renderer::FillPlainTile(int x0, int y0, int x1, int y1, const Hit* hits) {
  if (x1 == x0 || y1 == y0) return false;
  for (int k = 0; k < 4; ++k) {
    if (hits[k].surface != Hit::kGround || hits[k].slope > 0.7f) return false;
  }
  const int width = camera_.width;
  const int xs[] = {x0, x0, x1, x1}, ys[] = {y0, y1, y0, y1};
  Eigen::Vector3d points[4], directions[4];
  // Per corner: inverse depth, and the world times inverse depth, which are linear in the pixel on a plane.
  double inverse[4];
  Eigen::Vector3d scaled[4];
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3f& ray = rays_[static_cast<size_t>(ys[k]) * width + xs[k]];
    directions[k] = rows_[ys[k]].rotation * ray.cast<double>();
    points[k] = rows_[ys[k]].center + hits[k].distance * directions[k];
    inverse[k] = 1 / (hits[k].distance * ray.z());
    scaled[k] = points[k] * inverse[k];
  }
  if (!scene_->GroundIsClear(points, directions)) return false;
  const auto at = [&](double a, double b) {
    const double w[] = {(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b};
    Eigen::Vector4d value = Eigen::Vector4d::Zero();
    for (int k = 0; k < 4; ++k) value += w[k] * Eigen::Vector4d(scaled[k].x(), scaled[k].y(), scaled[k].z(), inverse[k]);
    return value;
  };
  for (const auto& [a, b] : {std::pair{0.5, 0.5}, {0.5, 0.0}, {0.5, 1.0}, {0.0, 0.5}, {1.0, 0.5}}) {
    const Eigen::Vector4d p = at(a, b);
    const Eigen::Vector3d world = p.head<3>() / p[3];
    if (std::abs(world.z() - scene_->grid.Height(world.x(), world.y())) > 2e-4 / p[3]) return false;
  }
  const double texels = scene_->ground_texels_per_metre;
  const double footprint = 0.25 * (hits[0].distance + hits[1].distance + hits[2].distance + hits[3].distance) * pixel_angle_;
  const double texel_width = footprint * texels;
  const bool simple = directions[0].z() < -0.7 && directions[3].z() < -0.7 && (scene_->detail == nullptr || texel_width > 0.53);
  const auto lod = static_cast<float>(std::log2(std::max(texel_width, 1e-3)));
  for (int y = y0; y < std::min(y0 + kTile, camera_.height); ++y) {
    const double b = static_cast<double>(y - y0) / (y1 - y0);
    Eigen::Vector4d p = at(0, b);
    const Eigen::Vector4d step = (at(1, b) - p) / (x1 - x0);
    const size_t row = static_cast<size_t>(y) * width;
    for (int x = x0; x < std::min(x0 + kTile, width); ++x, p += step) {
      const double depth = 1 / p[3];
      const auto distance = static_cast<float>(depth) / rays_[row + x].z();
      distance_[row + x] = distance;
      surface_[row + x] = Hit::kGround;
      Color color;
      if (simple) {
        color = scene_->ground->Sample(static_cast<float>((p[0] * depth - scene_->grid.x0) * texels - 0.5),
                                       static_cast<float>((p[1] * depth - scene_->grid.y0) * texels - 0.5), lod);
      } else {
        const Eigen::Vector3d direction = rows_[y].rotation * rays_[row + x].cast<double>();
        color = scene_->ShadeGround(p.head<3>() * depth, direction, distance * pixel_angle_, 0);
      }
      sharp_[row + x] = color * color;
    }
  }
  return true;
}

// Where the surface changes, or the depth jumps within one, the mean of four rays in place of one.
void Renderer::SmoothEdges(int y) {
  const int width = camera_.width;
  const size_t row = static_cast<size_t>(y) * width;
  const float jump = static_cast<float>(6 / std::sqrt(camera_.fx * camera_.fy));
  for (int x = 0; x < width; ++x) {
    const size_t i = row + x;
    smooth_[i] = sharp_[i];
    const auto differs = [&](size_t j) {
      return surface_[i] != surface_[j] || std::abs(distance_[i] - distance_[j]) > jump * distance_[i];
    };
    if (x == 0 || y == 0 || x + 1 == width || y + 1 == camera_.height) continue;
    if (!differs(i - 1) && !differs(i + 1) && !differs(i - width) && !differs(i + width)) continue;
    const Eigen::Vector3f right = rays_[i + 1] - rays_[i], down = rays_[i + width] - rays_[i];
    Color sum = {};
    for (const auto& [a, b] : {std::pair{-0.375f, -0.125f}, {0.125f, -0.375f}, {0.375f, 0.125f}, {-0.125f, 0.375f}}) {
      const Eigen::Vector3f ray = rays_[i] + a * right + b * down;
      const Eigen::Vector3d direction = (rows_[y].rotation * ray.cast<double>()).normalized();
      const Color color =
          scene_->Shade(rows_[y].center, direction, scene_->Cast(rows_[y].center, direction), pixel_angle_);
      sum += color * color;
    }
    smooth_[i] = sum * 0.25f;
  }
}

void Renderer::Project(const Motion& motion, const float* p, float* u, float* v) const {
  const float* r = motion.rotation;
  const float z = r[6] * p[0] + r[7] * p[1] + r[8] * p[2] + motion.translation[2];
  const float inverse = 1.f / std::max(z, 1e-3f);
  const float x = (r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + motion.translation[0]) * inverse;
  const float y = (r[3] * p[0] + r[4] * p[1] + r[5] * p[2] + motion.translation[1]) * inverse;
  if (!camera_.HasDistortion()) {
    *u = static_cast<float>(camera_.fx) * x + static_cast<float>(camera_.cx);
    *v = static_cast<float>(camera_.fy) * y + static_cast<float>(camera_.cy);
    return;
  }
  const Eigen::Vector2d pixel = camera_.Project(Eigen::Vector3d(x, y, 1));
  *u = static_cast<float>(pixel.x());
  *v = static_cast<float>(pixel.y());
}

void Renderer::BlurRow(int y) {
  const int width = camera_.width, height = camera_.height;
  const size_t row = static_cast<size_t>(y) * width;
  if (!options_.motion_blur || options_.exposure <= 0) {
    std::copy_n(smooth_.begin() + static_cast<std::ptrdiff_t>(row), width, blurred_.begin() + static_cast<std::ptrdiff_t>(row));
    return;
  }
  const auto motion = [&](int x) {
    const size_t i = row + x;
    const float distance = std::min(distance_[i], 1e5f);
    const float point[3] = {rays_[i].x() * distance, rays_[i].y() * distance, rays_[i].z() * distance};
    float x0, y0, x1, y1;
    Project(rows_[y].begin, point, &x0, &y0);
    Project(rows_[y].end, point, &x1, &y1);
    const float fx = static_cast<float>(x), fy = static_cast<float>(y);
    return Color{x0 - fx, y0 - fy, x1 - fx, y1 - fy};
  };
  const uint8_t* plain = plain_.data() + static_cast<size_t>(y / kTile) * ((width + kTile - 1) / kTile);
  Color tile_motion = {}, tile_step = {};
  for (int x = 0; x < width; ++x) {
    const size_t i = row + x;
    const float fx = static_cast<float>(x), fy = static_cast<float>(y);
    Color offset;
    if (!plain[x / kTile]) {
      offset = motion(x);
    } else {
      if (x % kTile == 0) {
        const int last = std::min(x + kTile, width) - 1;
        tile_motion = motion(x);
        tile_step = last > x ? (motion(last) - tile_motion) * (1.f / static_cast<float>(last - x)) : Color{};
      }
      offset = tile_motion + tile_step * static_cast<float>(x % kTile);
    }
    const float x0 = offset[0], y0 = offset[1], x1 = offset[2], y1 = offset[3];
    const float length = std::sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0));
    if (length < 0.5f) {
      blurred_[i] = smooth_[i];
      continue;
    }
    // What passes over this pixel a part s of half the exposure before the middle lies, in the middle, at minus its motion.
    const int half = std::clamp(static_cast<int>(length * 0.5f + 0.5f), 1, 24);
    const float step = 1.f / (static_cast<float>(half) + 0.5f);
    Color sum = smooth_[i];
    const auto add = [&](float sx, float sy) {
      const float px = std::clamp(fx - sx, 0.f, static_cast<float>(width - 1) - 0.001f);
      const float py = std::clamp(fy - sy, 0.f, static_cast<float>(height - 1) - 0.001f);
      const int ix = static_cast<int>(px), iy = static_cast<int>(py);
      const float ax = px - static_cast<float>(ix), ay = py - static_cast<float>(iy);
      const Color* p = smooth_.data() + static_cast<size_t>(iy) * width + ix;
      const Color top = p[0] + (p[1] - p[0]) * ax, bottom = p[width] + (p[width + 1] - p[width]) * ax;
      sum += top + (bottom - top) * ay;
    };
    for (int k = 1; k <= half; ++k) {
      const float s = static_cast<float>(k) * step;
      add(x0 * s, y0 * s);
      add(x1 * s, y1 * s);
    }
    blurred_[i] = sum * (1.f / static_cast<float>(2 * half + 1));
  }
}

void Renderer::DevelopRow(int y, const SensorState& sensor, Frame* frame) const {
  const int width = camera_.width;
  const auto& table = GaussianTable();
  const float cx = static_cast<float>(width) / 2, cy = static_cast<float>(camera_.height) / 2;
  const float falloff = sensor.vignetting / (cx * cx + cy * cy);
  const float dy = static_cast<float>(y) - cy;
  const uint64_t row_seed = Hash(sensor.seed, static_cast<uint64_t>(y));
  const Color gain = Rgb(sensor.gain[0], sensor.gain[1], sensor.gain[2]);
  uint8_t* out = frame->bgr.data() + static_cast<size_t>(y) * width * 3;
  const Color* light = blurred_.data() + static_cast<size_t>(y) * width;
  for (int x = 0; x < width; ++x, out += 3) {
    const float dx = static_cast<float>(x) - cx;
    const Color value = light[x] * gain * (1.f - falloff * (dx * dx + dy * dy));
    const uint64_t random = Hash(row_seed + static_cast<uint64_t>(x));
    // Photon noise is constant after the square root, so one figure serves for bright and dark.
    for (int c = 0; c < 3; ++c) {
      const float noise = table[(random >> (12 * c)) & 4095] * sensor.noise;
      out[2 - c] = static_cast<uint8_t>(std::clamp(std::sqrt(value[c]) + noise + 0.5f, 0.f, 255.f));
    }
  }
}

}  // namespace mapmend::simulate

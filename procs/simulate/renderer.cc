#include "procs/simulate/renderer.h"

#include <cmath>

#include "procs/simulate/parallel.h"

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

}  // namespace

Renderer::Renderer(const Scene* scene, const Camera& camera, const RenderOptions& options)
    : scene_(scene), camera_(camera), options_(options), distorted_(camera.HasDistortion()) {
  const size_t size = static_cast<size_t>(camera.width) * camera.height;
  rays_.resize(size);
  ray_stretch_.resize(size);
  ParallelFor(camera.height, 16, options.num_threads, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const size_t i = static_cast<size_t>(y) * camera.width + x;
        rays_[i] = Unproject(camera, Eigen::Vector2d(x, y)).normalized().cast<float>();
        ray_stretch_[i] = 1 / rays_[i].z();
      }
    }
  });
  pixel_angle_ = std::exp2(options.lod_bias) / std::sqrt(camera.fx * camera.fy);
  rows_.resize(camera.height);
  distance_.resize(size);
  surface_.resize(size);
  plain_.resize(static_cast<size_t>((camera.width + kTile - 1) / kTile) * ((camera.height + kTile - 1) / kTile));
  beams_.resize(plain_.size());
  light_.resize(size);
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
  time_ = time;
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
  ParallelFor((height + kTile - 1) / kTile, 1, options_.num_threads, [&](int begin, int end) {
    for (int tile_row = begin; tile_row < end; ++tile_row) CastTiles(tile_row);
  });
  ParallelFor(height, 16, options_.num_threads, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) SmoothEdges(y);
  });
  ParallelFor(height, 24, options_.num_threads, [&](int begin, int end) { DevelopRows(begin, end, sensor, frame); });
}

void Renderer::CastPixel(int x, int y, const Beam& beam) {
  const RowPose& row = rows_[y];
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  const Eigen::Vector3d direction = row.rotation * rays_[i].cast<double>();
  const Hit hit = scene_->Cast(row.center, direction, beam);
  distance_[i] = static_cast<float>(hit.distance);
  surface_[i] = hit.surface;
  const Color color = scene_->Shade(row.center, direction, hit, pixel_angle_, time_);
  light_[i] = PackLight(color);
}

void Renderer::CastTiles(int tile_row) {
  const int width = camera_.width, y0 = tile_row * kTile, y1 = std::min(y0 + kTile, camera_.height - 1);
  const int tiles = (width + kTile - 1) / kTile;
  // Corners in the order of PlainTile; the right ones become the next tile's left ones.
  Eigen::Vector3d origins[4], directions[4];
  Hit hits[4];
  const auto aim = [&](int x, int corner) {
    for (const int y : {y0, y1}) {
      origins[corner] = rows_[y].center;
      directions[corner++] = rows_[y].rotation * rays_[static_cast<size_t>(y) * width + x].cast<double>();
    }
  };
  aim(0, 2);
  for (int k = 0; k < tiles; ++k) {
    const int x0 = k * kTile, x1 = std::min(x0 + kTile, width - 1);
    for (int c = 0; c < 2; ++c) origins[c] = origins[c + 2], directions[c] = directions[c + 2], hits[c] = hits[c + 2];
    aim(x1, 2);
    const Beam beam = scene_->ClearBeam(origins, directions);
    for (int c = k == 0 ? 0 : 2; c < 4; ++c) hits[c] = scene_->Cast(origins[c], directions[c], beam);
    const int x_end = std::min(x0 + kTile, width), y_end = std::min(y0 + kTile, camera_.height);
    const bool plain = FillPlainTile(x0, y0, x1, y1, x_end, y_end, beam, hits);
    const size_t tile = static_cast<size_t>(tile_row) * tiles + k;
    plain_[tile] = !plain ? 0 : IsStill(x0, y0, x_end - 1, y_end - 1) ? kStill : kPlain;
    beams_[tile] = beam;
    if (!plain) CastTile(x0, y0, x1, y1, beam, hits);
  }
}

// Quarters that are plain, and every pixel of the others.
void Renderer::CastTile(int x0, int y0, int x1, int y1, const Beam& beam, const Hit* hits) {
  constexpr int kHalf = kTile / 2;
  const int x_end = std::min(x0 + kTile, camera_.width), y_end = std::min(y0 + kTile, camera_.height);
  const auto cast_pixels = [&](int left, int top, int right, int bottom) {
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) CastPixel(x, y, beam);
    }
  };
  if (x1 - x0 != kTile || y1 - y0 != kTile || beam.height > 1e29) return cast_pixels(x0, y0, x_end, y_end);
  const int xs[] = {x0, x0 + kHalf, x1}, ys[] = {y0, y0 + kHalf, y1};
  Hit grid[3][3];  // by column and row
  Eigen::Vector3d origins[4], directions[4];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (i != 1 && j != 1) {
        grid[i][j] = hits[i + j / 2];
      } else {
        grid[i][j] = scene_->Cast(
            rows_[ys[j]].center,
            rows_[ys[j]].rotation * rays_[static_cast<size_t>(ys[j]) * camera_.width + xs[i]].cast<double>(), beam);
      }
    }
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const Hit corners[] = {grid[i][j], grid[i][j + 1], grid[i + 1][j], grid[i + 1][j + 1]};
      bool alike = true;
      for (const Hit& hit : corners) alike &= hit.surface == corners[0].surface;
      if (alike) {
        for (int c = 0; c < 4; ++c) {
          const int y = ys[j + c % 2];
          origins[c] = rows_[y].center;
          directions[c] =
              rows_[y].rotation * rays_[static_cast<size_t>(y) * camera_.width + xs[i + c / 2]].cast<double>();
        }
        if (FillPlainTile(xs[i], ys[j], xs[i + 1], ys[j + 1], xs[i + 1], ys[j + 1],
                          scene_->ClearBeam(origins, directions), corners))
          continue;
      }
      cast_pixels(xs[i], ys[j], xs[i + 1], ys[j + 1]);
    }
  }
}

// Where the surface changes, or the depth jumps within one, the mean of four rays in place of one. Inside plain tiles
// neither can be.
void Renderer::SmoothEdges(int y) {
  const int width = camera_.width;
  if (y == 0 || y + 1 == camera_.height) return;
  const bool edge_row = y % kTile == 0 || y % kTile == kTile - 1;
  const uint8_t* plain = plain_.data() + static_cast<size_t>(y / kTile) * ((width + kTile - 1) / kTile);
  for (int x = 1; x + 1 < width; ++x) {
    if (!edge_row && plain[x / kTile] && x % kTile != 0 && x % kTile != kTile - 1) {
      x += kTile - 2 - x % kTile;
      continue;
    }
    SmoothPixel(x, y);
  }
}

void Renderer::SmoothPixel(int x, int y) {
  const int width = camera_.width;
  const size_t i = static_cast<size_t>(y) * width + x;
  const float jump = distance_[i] * static_cast<float>(6 / std::sqrt(camera_.fx * camera_.fy));
  const auto differs = [&](size_t j) {
    return surface_[i] != surface_[j] || std::abs(distance_[i] - distance_[j]) > jump;
  };
  if (!differs(i - 1) && !differs(i + 1) && !differs(i - width) && !differs(i + width)) return;
  const Eigen::Vector3f right = rays_[i + 1] - rays_[i], down = rays_[i + width] - rays_[i];
  const Beam& beam = beams_[static_cast<size_t>(y / kTile) * ((width + kTile - 1) / kTile) + x / kTile];
  Color sum = {};
  for (const auto& [a, b] : {std::pair{-0.375f, -0.125f}, {0.125f, -0.375f}, {0.375f, 0.125f}, {-0.125f, 0.375f}}) {
    const Eigen::Vector3f ray = rays_[i] + a * right + b * down;
    const Eigen::Vector3d direction = (rows_[y].rotation * ray.cast<double>()).normalized();
    const Color color =
        scene_->Shade(rows_[y].center, direction, scene_->Cast(rows_[y].center, direction, beam), pixel_angle_, time_);
    sum += color * color;
  }
  light_[i] = PackLight(SquareRoot(sum * 0.25f));
}

}  // namespace mapmend::simulate

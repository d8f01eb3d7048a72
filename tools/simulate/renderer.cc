#include "tools/simulate/renderer.h"

#include <bit>
#include <cmath>
#include <cstring>

#include "tools/simulate/parallel.h"

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
  // Eight are read at a time.
  ray_stretch_.resize(size + 8, 1.f);
  plane_x_.resize(size + 8);
  plane_y_.resize(size + 8);
  ParallelFor(camera.height, 16, options.num_threads, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const size_t i = static_cast<size_t>(y) * camera.width + x;
        const Eigen::Vector3d ray = Unproject(camera, Eigen::Vector2d(x, y));
        rays_[i] = ray.normalized().cast<float>();
        ray_stretch_[i] = 1 / rays_[i].z();
        plane_x_[i] = static_cast<float>(ray.x());
        plane_y_[i] = static_cast<float>(ray.y());
      }
    }
  });
  pixel_angle_ = std::exp2(options.lod_bias) / std::sqrt(camera.fx * camera.fy);
  rows_.resize(camera.height);
  distance_.resize(size + 8);
  surface_.resize(size + 8);
  edge_slope_ = static_cast<float>(6 / std::sqrt(camera.fx * camera.fy));
  smoothed_.resize((camera.height + kTile - 1) / kTile);
  tiles_.resize(static_cast<size_t>((camera.width + kTile - 1) / kTile) * smoothed_.size());
  motions_.resize(tiles_.size());
  corner_motions_.resize(smoothed_.size());
  lens_ = {static_cast<float>(camera.fx),
           static_cast<float>(camera.fy),
           static_cast<float>(camera.cx),
           static_cast<float>(camera.cy),
           {},
           distorted_};
  for (int k = 0; k < 5; ++k) lens_.distortion[k] = static_cast<float>(camera.distortion[k]);
  facet_rows_.resize(smoothed_.size());
  facet_lists_.resize(smoothed_.size());
  light_.resize(size);
  const int tiles = (camera.width + kTile - 1) / kTile;
  for (size_t t = 0; t < tiles_.size(); ++t) {
    const int x0 = static_cast<int>(t % tiles) * kTile, y0 = static_cast<int>(t / tiles) * kTile;
    const int x_end = std::min(x0 + kTile, camera.width), y_end = std::min(y0 + kTile, camera.height);
    FacetRow::Bounds b{1e9f, 1e9f, -1e9f, -1e9f};
    for (int y = y0; y < y_end; ++y) {
      for (int x = x0; x < x_end; ++x) {
        const size_t i = static_cast<size_t>(y) * camera.width + x;
        b = {std::min(b.x0, plane_x_[i]), std::min(b.y0, plane_y_[i]), std::max(b.x1, plane_x_[i]),
             std::max(b.y1, plane_y_[i])};
      }
    }
    const float dx = 0.6f * (b.x1 - b.x0) / static_cast<float>(std::max(1, x_end - x0 - 1)),
                dy = 0.6f * (b.y1 - b.y0) / static_cast<float>(std::max(1, y_end - y0 - 1));
    tile_bounds_.push_back({b.x0 - dx, b.y0 - dy, b.x1 + dx, b.y1 + dy});
  }
}

Eigen::Vector3d Renderer::Ray(int x, int y) const {
  return rays_[static_cast<size_t>(y) * camera_.width + x].cast<double>().normalized();
}

// With a moving shutter every eighth row's pose is computed and those between interpolated: a camera does not change
// its motion within a tenth of a millisecond.
void Renderer::FindPoses(const PoseFunction& pose) {
  struct Node {
    Rigid3 begin, middle, end;
  };
  const int height = camera_.height, tile_rows = (height + kTile - 1) / kTile;
  const auto node_at = [&](double y) {
    const double time = time_ + (y / (height - 1) - 0.5) * options_.readout;
    return Node{pose(time - options_.exposure / 2), pose(time), pose(time + options_.exposure / 2)};
  };
  const auto set = [this](const Node& node, int y) {
    const auto relative = [&node](const Rigid3& world_from_cam) {
      const Rigid3 cam_from_mid = world_from_cam.Inverse() * node.middle;
      Motion motion;
      const Eigen::Matrix3f rotation = cam_from_mid.rotation.toRotationMatrix().cast<float>();
      for (int i = 0; i < 9; ++i) motion.rotation[i] = rotation(i / 3, i % 3);
      for (int i = 0; i < 3; ++i) motion.translation[i] = static_cast<float>(cam_from_mid.translation[i]);
      return motion;
    };
    rows_[y] = {node.middle.rotation.toRotationMatrix(), node.middle.translation, relative(node.begin),
                relative(node.end)};
  };
  const auto between = [](const Rigid3& a, const Rigid3& b, double part) {
    const double sign = a.rotation.dot(b.rotation) < 0 ? -1 : 1;
    const Eigen::Quaterniond rotation(a.rotation.coeffs() * (1 - part) + b.rotation.coeffs() * (sign * part));
    return Rigid3{rotation.normalized(), a.translation + part * (b.translation - a.translation)};
  };
  const bool rolling = options_.readout != 0;
  const Node whole = rolling ? Node{} : node_at(0);
  ParallelFor(tile_rows, 16, options_.num_threads, [&](int first, int last) {
    Node below = rolling ? node_at(first * kTile) : whole;
    for (int t = first; t < last; ++t) {
      const Node above = below;
      if (rolling) below = node_at((t + 1) * kTile);
      const int y0 = t * kTile, y1 = std::min(y0 + kTile, height) - 1;
      for (int y = y0; y <= y1; ++y) {
        if (!rolling && y > first * kTile) {
          rows_[y] = rows_[y - 1];
          continue;
        }
        const double part = static_cast<double>(y - y0) / kTile;
        set({between(above.begin, below.begin, part), between(above.middle, below.middle, part),
             between(above.end, below.end, part)},
            y);
      }
      for (int lane = 0; lane < 8; ++lane) {
        const RowPose& row = rows_[lane % 2 == 0 ? y0 : y1];
        const auto copy = [lane](const Motion& from, float(*to)[8]) {
          for (int i = 0; i < 9; ++i) to[i][lane] = from.rotation[i];
          for (int i = 0; i < 3; ++i) to[9 + i][lane] = from.translation[i];
        };
        copy(row.begin, corner_motions_[t].begin);
        copy(row.end, corner_motions_[t].end);
      }
    }
  });
}

void Renderer::Render(const PoseFunction& pose, double time, const SensorState& sensor, Frame* frame) {
  const int width = camera_.width, height = camera_.height;
  time_ = time;
  FindPoses(pose);
  frame->width = width;
  frame->height = height;
  frame->bgr.resize(static_cast<size_t>(width) * height * 3);
  const int tile_rows = (height + kTile - 1) / kTile;
  facets_ = FacetRow::Serves(*scene_, rows_.front().center) && FacetRow::Serves(*scene_, rows_.back().center);
  if (facets_)
    ParallelFor(tile_rows, 1, options_.num_threads, [&](int tile_row, int) { DrawFacets(tile_row); });
  else
    ParallelFor((tile_rows + 1) / 2, 1, options_.num_threads, [&](int pair, int) { CastTiles(pair); });
  // Put in place when all are there: each looks at its neighbours as they were.
  ParallelFor(tile_rows, 1, options_.num_threads, [&](int tile_row, int) {
    smoothed_[tile_row].clear();
    facets_ ? SmoothFacets(tile_row, &smoothed_[tile_row]) : SmoothEdges(tile_row, &smoothed_[tile_row]);
  });
  for (const auto& row : smoothed_) {
    for (const Smoothed& pixel : row) light_[pixel.index] = pixel.light;
  }
  ParallelFor(height, 5 * kTile, options_.num_threads,
              [&](int begin, int end) { DevelopRows(begin, end, sensor, frame); });
}

void Renderer::CastPixel(int x, int y, const Beam& beam) {
  const RowPose& row = rows_[y];
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  const Eigen::Vector3d direction = Direction(x, y);
  const Hit hit = scene_->Cast(row.center, direction, beam);
  distance_[i] = static_cast<float>(hit.distance);
  surface_[i] = hit.surface;
  const Color color = scene_->Shade(row.center, direction, hit, pixel_angle_, time_);
  light_[i] = PackLight(color);
}

bool Renderer::FillBetween(const std::array<Corner*, 4>& corners, int x_end, int y_end, const Beam& beam, Hit* hits) {
  for (size_t c = 0; c < 4; ++c) {
    Corner& corner = *corners[c];
    if (!corner.known) corner.hit = scene_->Cast(rows_[corner.y].center, corner.direction, beam), corner.known = true;
    hits[c] = corner.hit;
  }
  return FillPlainTile(corners[0]->x, corners[0]->y, corners[3]->x, corners[3]->y, x_end, y_end, beam, hits);
}

// A pair of rows of tiles: four tiles at once where they show one even surface, otherwise one by one.
void Renderer::CastTiles(int pair) {
  const int width = camera_.width, height = camera_.height, tiles = (width + kTile - 1) / kTile;
  const int top = 2 * pair * kTile;
  // Rays at the corners of tiles, three by three, by column and row; the right ones become the next ones' left ones.
  Corner corners[3][3];
  const auto aim = [&](int column, int x) {
    for (int j = 0; j < 3; ++j) {
      const int y = std::min(top + j * kTile, height - 1);
      corners[column][j] = {x, y, Direction(x, y), {}, false};
    }
  };
  Eigen::Vector3d origins[4], directions[4];
  const auto beam_between = [&](int i0, int j0, int i1, int j1, const Beam& within) {
    const Corner* around[] = {&corners[i0][j0], &corners[i0][j1], &corners[i1][j0], &corners[i1][j1]};
    for (int c = 0; c < 4; ++c) origins[c] = rows_[around[c]->y].center, directions[c] = around[c]->direction;
    return scene_->ClearBeam(origins, directions, within);
  };
  const auto fill = [&](int i0, int j0, int i1, int j1, int x_end, int y_end, const Beam& beam, Hit* hits) {
    return FillBetween({&corners[i0][j0], &corners[i0][j1], &corners[i1][j0], &corners[i1][j1]}, x_end, y_end, beam,
                       hits);
  };
  constexpr int kGroup = 4;  // what is above so many tiles is found first
  // Between corners farther apart a distorted image or a moving shutter is not straight enough.
  const bool straight = !distorted_ && options_.readout == 0;
  Beam group;
  Hit hits[4];
  aim(2, 0);
  for (int k = 0; k < tiles; k += 2) {
    for (int j = 0; j < 3; ++j) corners[0][j] = corners[2][j];
    const int x0 = k * kTile;
    if (k % kGroup == 0) {
      aim(2, std::min(x0 + kGroup * kTile, width - 1));
      group = beam_between(0, 0, 2, 2, {});
    }
    aim(1, std::min(x0 + kTile, width - 1));
    aim(2, std::min(x0 + 2 * kTile, width - 1));
    const Beam both = beam_between(0, 0, 2, 2, group);
    const int x_end = x0 + 2 * kTile, y_end = top + 2 * kTile;
    if (straight && x_end < width && y_end < height && fill(0, 0, 2, 2, x_end, y_end, both, hits)) {
      const int first = 2 * pair * tiles + k;
      for (const int each : {first, first + 1, first + tiles, first + tiles + 1})
        tiles_[each] = {both, hits[0].surface, true, FindMotion(each, true)};
      continue;
    }
    for (int i = 0; i < 2 && x0 + i * kTile < width; ++i) {
      for (int j = 0; j < 2 && top + j * kTile < height; ++j) {
        const int left = x0 + i * kTile, above = top + j * kTile;
        const int right = std::min(left + kTile, width), below = std::min(above + kTile, height);
        const Beam beam = beam_between(i, j, i + 1, j + 1, both);
        const bool plain = fill(i, j, i + 1, j + 1, right, below, beam, hits);
        if (!plain) CastTile(left, above, corners[i + 1][j].x, corners[i][j + 1].y, beam, hits);
        const int each = (2 * pair + j) * tiles + k + i;
        tiles_[each] = {beam, hits[0].surface, plain, FindMotion(each, plain)};
      }
    }
  }
}

// Where the surface changes, or the depth jumps within one, the mean of four rays in place of one. Inside plain tiles
// neither can be, nor between plain tiles of one surface.
void Renderer::SmoothEdges(int tile_row, std::vector<Smoothed>* smoothed) const {
  const int width = camera_.width, tiles = (width + kTile - 1) / kTile;
  const int y_end = std::min((tile_row + 1) * kTile, camera_.height - 1);
  for (int k = 0; k < tiles; ++k) {
    const TileState* tile = tiles_.data() + static_cast<size_t>(tile_row) * tiles + k;
    const auto joins = [tile](const TileState& other) { return other.plain && other.surface == tile->surface; };
    const int x_end = std::min((k + 1) * kTile, width - 1), x0 = k * kTile, y0 = tile_row * kTile;
    const bool inner = tile->plain;
    bool left = !inner, right = !inner, above = !inner, below = !inner;
    if (inner) {
      left = k > 0 && !joins(tile[-1]);
      right = k + 1 < tiles && !joins(tile[1]);
      above = tile_row > 0 && !joins(tile[-tiles]);
      below = y0 + kTile < camera_.height && !joins(tile[tiles]);
      if (!left && !right && !above && !below) continue;
    }
    for (int y = std::max(y0, 1); y < y_end; ++y) {
      const bool whole = !inner || (above && y == y0) || (below && y == y0 + kTile - 1);
      if (whole && x_end - x0 == kTile && x0 > 0) {
        for (unsigned edges = Edges(x0, y) | Edges(x0 + 4, y) << 4; edges != 0; edges &= edges - 1)
          SmoothPixel(x0 + std::countr_zero(edges), y, tile->beam, smoothed);
        continue;
      }
      for (int x = std::max(x0, 1); x < x_end; ++x) {
        if (whole || (left && x == x0) || (right && x == x0 + kTile - 1)) SmoothPixel(x, y, tile->beam, smoothed);
      }
    }
  }
}

unsigned Renderer::Edges(int x, int y) const {
  const size_t i = static_cast<size_t>(y) * camera_.width + x;
  Color distance;
  Int4 surface, differ = {};
  std::memcpy(&distance, &distance_[i], sizeof distance);
  std::memcpy(&surface, &surface_[i], sizeof surface);
  const Color jump = distance * edge_slope_;
  for (const size_t k : {i - 1, i + 1, i - camera_.width, i + camera_.width}) {
    Color there;
    Int4 other;
    std::memcpy(&there, &distance_[k], sizeof there);
    std::memcpy(&other, &surface_[k], sizeof other);
    differ |= (other != surface) | (there - distance > jump) | (distance - there > jump);
  }
  return Lanes(differ);
}

void Renderer::SmoothPixel(int x, int y, const Beam& beam, std::vector<Smoothed>* smoothed) const {
  const int width = camera_.width;
  const size_t i = static_cast<size_t>(y) * width + x;
  const float jump = distance_[i] * edge_slope_;
  const auto differs = [&](size_t j) {
    return surface_[i] != surface_[j] || std::abs(distance_[i] - distance_[j]) > jump;
  };
  const size_t pixels[] = {i, i - 1, i + 1, i - width, i + width};
  const bool to_left = differs(i - 1), to_right = differs(i + 1), above = differs(i - width),
             below = differs(i + width);
  if (!to_left && !to_right && !above && !below) return;
  const Eigen::Vector3f right = rays_[i + 1] - rays_[i], down = rays_[i + width] - rays_[i];
  Color sum = {};
  for (const auto& [a, b] : {std::pair{-0.375f, -0.125f}, {0.125f, -0.375f}, {0.375f, 0.125f}, {-0.125f, 0.375f}}) {
    // On the side away from the edge the ray would hit what the pixel's own has hit.
    if (!(a < 0 ? to_left : to_right) && !(b < 0 ? above : below)) {
      sum += UnpackLight(light_[i]);
      continue;
    }
    const Eigen::Vector3f ray = rays_[i] + a * right + b * down;
    const Eigen::Vector3d direction = (rows_[y].rotation * ray.cast<double>()).normalized();
    const Hit hit = scene_->Cast(rows_[y].center, direction, beam);
    // Mostly a neighbour shows the same surface: its colour will do.
    size_t like = 0;
    float nearest = jump;
    for (const size_t k : pixels) {
      const float apart = std::abs(distance_[k] - static_cast<float>(hit.distance));
      if (surface_[k] == hit.surface && apart < nearest) nearest = apart, like = k;
    }
    if (like > 0) {
      sum += UnpackLight(light_[like]);
    } else {
      const Color color = scene_->Shade(rows_[y].center, direction, hit, pixel_angle_, time_);
      sum += color * color;
    }
  }
  smoothed->push_back({i, PackLight(SquareRoot(sum * 0.25f))});
}

}  // namespace mapmend::simulate

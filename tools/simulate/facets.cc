#include "tools/simulate/facets.h"

#include <cmath>
#include <limits>

namespace mapmend::simulate {
namespace {

constexpr float kFarAway = std::numeric_limits<float>::infinity();

// Bit k: lane k is below zero.
int Negative(const Color& v) {
#if defined(__SSE4_1__)
  return _mm_movemask_ps(v);
#else
  int bits = 0;
  for (int k = 0; k < 4; ++k) bits |= v[k] < 0 ? 1 << k : 0;
  return bits;
#endif
}
float Least(const Color& v) { return std::min(std::min(v[0], v[1]), std::min(v[2], v[3])); }
float Greatest(const Color& v) { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }

Color Along(const Color& linear, const Color& x, const Color& y) { return linear[0] * x + (linear[1] * y + linear[2]); }

Color ToColor(const Eigen::Vector3d& v) {
  return Color{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()), 0.f};
}

RayLinear Between(const Eigen::Vector3d& first, const Eigen::Vector3d& last, int rows) {
  return {ToColor(first), ToColor((last - first) / rows)};
}

// The ground as a solid: its surface and the vertical planes at its borders.
std::vector<Face> GroundFaces(const Scene& scene) {
  const HeightGrid& grid = scene.grid;
  std::vector<Face> faces(5);
  faces[0].normal = Eigen::Vector3d::UnitZ();
  faces[0].offset = grid.At(0, 0);
  const double scale = scene.ground_texels_per_metre;
  faces[0].texture = 0;
  faces[0].u = {scale, 0, 0}, faces[0].v = {0, scale, 0};
  faces[0].u0 = -grid.x0 * scale - 0.5, faces[0].v0 = -grid.y0 * scale - 0.5;
  faces[0].texels_per_metre = static_cast<float>(scale);
  faces[0].color = Color{1, 1, 1, 1};
  faces[1].normal = -Eigen::Vector3d::UnitX(), faces[1].offset = -grid.x0;
  faces[2].normal = -Eigen::Vector3d::UnitY(), faces[2].offset = -grid.y0;
  faces[3].normal = Eigen::Vector3d::UnitX(), faces[3].offset = grid.x0 + (grid.width - 1) * grid.spacing;
  faces[4].normal = Eigen::Vector3d::UnitY(), faces[4].offset = grid.y0 + (grid.height - 1) * grid.spacing;
  return faces;
}

}  // namespace

bool FacetRow::Serves(const Scene& scene, const Eigen::Vector3d& center) {
  if (!scene.IsLevel() || scene.detail != nullptr || scene.foliage > 0 || scene.continues) return false;
  const HeightGrid& grid = scene.grid;
  const double x = center.x() - grid.x0, y = center.y() - grid.y0;
  return center.z() > grid.At(0, 0) + 1e-3 && x > 1e-3 && y > 1e-3 && x < (grid.width - 1) * grid.spacing - 1e-3 &&
         y < (grid.height - 1) * grid.spacing - 1e-3;
}

void FacetRow::Prepare(const Scene& scene, const Rigid3& first, const Rigid3& last, int rows, const Bounds& bounds,
                       float pixel_angle) {
  solids_.clear();
  planes_.clear();
  looks_.clear();
  rows_ = rows;
  Pose poses[2];
  for (int k = 0; k < 2; ++k) {
    const Rigid3& pose = k == 0 ? first : last;
    poses[k] = {pose.rotation.toRotationMatrix().transpose(), pose.translation};
  }
  rolling_ = (poses[0].center - poses[1].center).squaredNorm() > 0 ||
             (poses[0].camera_from_world - poses[1].camera_from_world).squaredNorm() > 0;
  sky_ = {pixel_angle, scene.sky_low, scene.sky_high,
          Between(poses[0].camera_from_world.col(2), poses[1].camera_from_world.col(2), rows)};
  Add(scene, Hit::kGround, GroundFaces(scene), poses);
  for (size_t s = 0; s < scene.solids.size(); ++s) {
    const Solid& solid = scene.solids[s];
    // Where its bounding box lies on the plane z = 1.
    float x0 = kFarAway, y0 = kFarAway, x1 = -kFarAway, y1 = -kFarAway;
    bool before = false, behind = false;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d at(corner & 1 ? solid.low.x() : solid.high.x(), corner & 2 ? solid.low.y() : solid.high.y(),
                               corner & 4 ? solid.low.z() : solid.high.z());
      for (int k = 0; k < (rolling_ ? 2 : 1); ++k) {
        const Eigen::Vector3d p = poses[k].camera_from_world * (at - poses[k].center);
        if (p.z() < 1e-3) {
          behind = true;
          continue;
        }
        before = true;
        const float x = static_cast<float>(p.x() / p.z()), y = static_cast<float>(p.y() / p.z());
        x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
      }
    }
    if (!before) continue;
    if (behind) {
      x0 = y0 = -kFarAway, x1 = y1 = kFarAway;
    } else if (x1 < bounds.x0 || x0 > bounds.x1 || y1 < bounds.y0 || y0 > bounds.y1) {
      continue;
    }
    const size_t before_it = solids_.size();
    Add(scene, 1 + 8 * static_cast<int>(s), solid.faces, poses);
    if (solids_.size() == before_it) continue;
    FacetSolid& added = solids_.back();
    added.x0 = x0, added.y0 = y0, added.x1 = x1, added.y1 = y1;
  }
}

void FacetRow::Add(const Scene& scene, int surface, const std::vector<Face>& faces, const Pose* poses) {
  FacetSolid solid{static_cast<int>(planes_.size()), 0, 0, -kFarAway, -kFarAway, kFarAway, kFarAway};
  double heights[8][2];
  for (size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 2; ++k) heights[f][k] = faces[f].normal.dot(poses[k].center) - faces[f].offset;
  }
  for (const bool front : {true, false}) {
    for (size_t f = 0; f < faces.size(); ++f) {
      const Face& face = faces[f];
      if ((heights[f][0] > 0) != front) continue;
      // A camera that crosses the plane within a row of tiles counts as being on the side where it began.
      Eigen::Vector3d inverse[2], u[2], v[2], along_u[2], along_v[2];
      for (int k = 0; k < 2; ++k) {
        const double height = front ? std::max(heights[f][k], 1e-6) : std::min(heights[f][k], -1e-6);
        inverse[k] = poses[k].camera_from_world * face.normal / -height;
        along_u[k] = poses[k].camera_from_world * face.u;
        along_v[k] = poses[k].camera_from_world * face.v;
        u[k] = along_u[k] + (face.u.dot(poses[k].center) + face.u0) * inverse[k];
        v[k] = along_v[k] + (face.v.dot(poses[k].center) + face.v0) * inverse[k];
      }
      planes_.push_back({Between(inverse[0], inverse[1], rows_), surface + (surface > 0 ? static_cast<int>(f) : 0)});
      ++solid.num_planes;
      FacetLook look{};
      if (front) {
        ++solid.num_front;
        look.tint = face.color;
        look.u = Between(u[0], u[1], rows_), look.v = Between(v[0], v[1], rows_);
        look.along_u = Between(along_u[0], along_u[1], rows_), look.along_v = Between(along_v[0], along_v[1], rows_);
        look.texels_per_metre = face.texels_per_metre;
        look.height = static_cast<float>(heights[f][0]);
        if (face.texture >= 0) {
          look.texture = surface == Hit::kGround ? scene.ground.get() : scene.textures[face.texture].get();
          look.last_level = look.texture->LastWhole();
        }
      }
      looks_.push_back(look);
    }
  }
  if (solid.num_front > 0) {
    solids_.push_back(solid);
  } else {
    planes_.resize(solid.first);
    looks_.resize(solid.first);
  }
}

FacetRow::Seen FacetRow::See(const FacetSolid& solid, const Bounds& tile) const {
  const Color x = {tile.x0, tile.x1, tile.x0, tile.x1}, y = {tile.y0, tile.y0, tile.y1, tile.y1};
  const int poses = rolling_ ? 2 : 1, num_planes = std::min(solid.num_planes, 8);
  Color at[2][8];
  for (auto& pose : at) std::fill(std::begin(pose), std::end(pose), Color{});
  const FacetPlane* planes = planes_.data() + solid.first;
  for (int k = 0; k < poses; ++k) {
    for (int p = 0; p < num_planes; ++p) {
      const Color w = planes[p].inverse.AtRow(k == 0 ? 0.f : static_cast<float>(rows_));
      at[k][p] = Along(w, x, y);
    }
  }
  Seen seen{false, true, -1, kFarAway, kFarAway};
  for (int f = 0; f < solid.num_front; ++f) {
    float high = Greatest(at[0][f]), low = Least(at[0][f]);
    if (poses == 2) high = std::max(high, Greatest(at[1][f])), low = std::min(low, Least(at[1][f]));
    if (high <= 0) return seen;
    seen.whole &= low > 0;
    seen.low = std::min(seen.low, low), seen.high = std::min(seen.high, high);
    // In front of plane b at all four corners, so everywhere between.
    for (int b = solid.num_front; b < num_planes; ++b) {
      int behind = Negative(at[0][f] - at[0][b]);
      if (poses == 2) behind |= Negative(at[1][f] - at[1][b]) << 4;
      if (behind == (poses == 2 ? 255 : 15)) return seen;
      seen.whole &= behind == 0;
    }
    bool first = true;
    for (int other = 0; other < solid.num_front && first; ++other) {
      if (other == f) continue;
      first = Negative(at[0][other] - at[0][f]) == 0 && (poses == 1 || Negative(at[1][other] - at[1][f]) == 0);
    }
    if (first && seen.plane < 0) seen.plane = solid.first + f;
  }
  seen.any = true;
  return seen;
}

Int4 FacetRow::Meet(const uint16_t* solids, int num_solids, float row, const Color& x, const Color& y,
                    Color* inverse) const {
  Color nearest = {};
  Int4 plane = Int4{} - 1;
  for (int s = 0; s < num_solids; ++s) {
    const FacetSolid& solid = solids_[solids[s]];
    Color enter = Color{} + kFarAway, leave = {};
    Int4 front = {};
    for (int p = solid.first; p < solid.first + solid.num_front; ++p) {
      const Color w = Along(planes_[p].inverse.AtRow(row), x, y);
      const Int4 below = w < enter;
      enter = below ? w : enter;
      front = below ? Int4{} + p : front;
    }
    for (int p = solid.first + solid.num_front; p < solid.first + solid.num_planes; ++p) {
      const Color w = Along(planes_[p].inverse.AtRow(row), x, y);
      leave = w > leave ? w : leave;
    }
    const Int4 met = (enter > leave) & (enter > nearest);
    nearest = met ? enter : nearest;
    plane = met ? front : plane;
  }
  *inverse = nearest;
  return plane;
}

}  // namespace mapmend::simulate

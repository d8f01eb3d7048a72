#pragma once

#include <cstdint>

#include "tools/simulate/facets.h"

namespace mapmend::simulate {

// Up to eight neighbouring pixels of a row of a tile. `count` of them are written; all eight are read.
struct PixelRow {
  const float *x, *y;    // of the rays (x, y, 1)
  const float* stretch;  // lengths of those
  float* distance;
  int* surface;
  Light* light;
  int count;
  float row;  // within the tile
};

// How what a piece of a row shows moves from the middle of the exposure to its beginning (x, y) and its end (x, y), in
// pixels: base + slope / distance, which change by the steps from pixel to pixel.
struct RowMotion {
  Color base, base_step, slope, slope_step;
};

// A grid of brightnesses of leaves: point (u, v) lies at (u * scale + u0, v * scale + v0) in cells.
struct LeafCells {
  const float* cells;
  int stride;
  float scale, u0, v0;
};

// How a piece of a plane looks that is seen steeply: two levels of its texture (the first only unless `two`) and two of
// leaves, if it `grows`. Texels of level 0 are relative to the piece.
struct PlainLook {
  struct Level {
    const uint32_t* texels;
    int width;
    float scale, u0, v0;  // texel of the level = texel * scale + (u0, v0)
  } levels[2];
  bool two, grows;
  int16_t part;  // of the second level, in 1/32767
  LeafCells leaves[2];
  Color tint;
  int surface;
};

// Inverse depth, and texels times it, of the first pixel of a row, and from pixel to pixel.
struct PlainRow {
  float u, du, v, dv, inverse, inverse_step;
};

// Where the rays (x, y, 1) of a row lie in the world: center + depth * (dx, dy, dz) . (x, y, 1).
struct WorldRow {
  float center[3];
  Color dx, dy, dz;
};

// A height field's cells: the greatest height of each, and which blocks of 2^block of them have solids (where
// `block_begin` grows).
struct HeightCells {
  const HeightGrid* grid;
  const float* max;
  const uint32_t* block_begin;
  int width, height, block, blocks_wide;
};

// Eight rays that go down steeply, from where they may first meet something: there in cells of the grid, relative to
// cell (i, j) and not below it, and height in metres; then the same per metre along the ray.
struct SteepRays {
  int i, j;
  float x[8], y[8], z[8], dx[8], dy[8], dz[8];
};

// How uneven ground looks, seen steeply from above.
struct GroundLook {
  const Texture* texture;
  int last_level;
  float texels, u0, v0;  // per metre; texel = metres * texels + (u0, v0)
  float texel_angle;     // texels that a pixel covers per metre of distance
  float foliage;         // contrast of leaves per alpha
  double repeat;         // of leaves along u, texels; 0 for never
  CanopyLevels levels;
  CanopyView leaves;
  DetailLook detail;
};

// Where the camera is at the beginning and at the end of the exposure, from its pose in the middle, in turn for the
// first and the last row of a row of tiles: nine numbers of the rotation, row by row, and three of the translation.
struct CornerMotion {
  float begin[12][8], end[12][8];
};

// A pinhole with radial-tangential distortion, as Camera.
struct Lens {
  float fx, fy, cx, cy, distortion[5];
  bool distorted;
};

// Points of eight rays (x, y, z) at these distances, seen from pixels.
struct CornerPoints {
  float x[8], y[8], z[8], distance[8], pixel_x[8], pixel_y[8];
};

// value = sqrt((light * clear + haze) * gain * (1 - falloff * r^2)), r in pixels from the middle of the picture.
struct Exposure {
  Color gain, haze;
  float clear, falloff;
};

// The inner loops of drawing, once for what every x86-64-v2 machine has and once for AVX2, chosen at run time. The
// operations are the same, and so are the bits.
struct RowKernels {
  // Distance, surface and light where any of `solids` may be seen.
  void (*draw_facets)(const FacetRow& facets, const uint16_t* solids, int num_solids, const PixelRow& pixels);
  // The same where one plane is sure to be seen.
  void (*draw_plane)(const FacetRow& facets, int plane, const PixelRow& pixels);
  // A piece of a plane from pixel `first` of its row on.
  void (*paint_plain)(const PlainLook& look, const PlainRow& row, int first, const PixelRow& pixels);
  // What paint_plain has painted, with detail. texel_angle: as of GroundLook.
  void (*add_detail)(const DetailLook& look, float texel_angle, const PlainRow& row, int first, const PixelRow& pixels);
  // Where rays of `lanes` meet the ground: metres along them, and its slope. Returns the lanes that are certain; the
  // others have left the grid or come to a block with solids.
  unsigned (*cast_down)(const HeightCells& cells, const SteepRays& rays, unsigned lanes, float* distance, float* slope);
  // Moves pixels of `lanes` along their rays onto the ground, from about these inverse depths: distance, surface, and
  // the ground's slope (of eight pixels). Returns the lanes that were not near enough.
  unsigned (*settle_on_ground)(const HeightGrid& grid, const WorldRow& world, const float* inverse, unsigned lanes,
                               const PixelRow& pixels, float* slope);
  // Light of the pixels in `lanes`, which show ground of this slope.
  void (*shade_ground)(const GroundLook& look, const WorldRow& world, const float* slope, unsigned lanes,
                       const PixelRow& pixels);
  // Light of `count` pixels from (x, y) on after motion blur; light: of the whole picture.
  void (*blur)(const Light* light, int width, int height, int x, int y, int count, const float* distance,
               const RowMotion& motion, Color* blurred);
  // The same for eight pixels that move alike, by offset[0], offset[1] to the beginning and offset[2], offset[3] to the
  // end of the exposure, and whose motion stays inside the picture.
  void (*blur_even)(const Light* light, int width, int x, int y, const Color& offset, Color* blurred);

  // How far the images of eight points are from their pixels at the beginning (0, 1) and the end (2, 3) of the
  // exposure.
  void (*move_corners)(const CornerMotion& motion, const Lens& lens, const CornerPoints& points, Color* moved);
  // Light to values, in place; the first pixel lies at (x, y) from the middle of the picture.
  void (*expose)(const Exposure& exposure, float x, float y, int count, Color* row);
  // lines[1] plus `amount` of its difference to the mean of 3 x 3 pixels. sums: room for width + 2.
  void (*sharpen)(const Color* const* lines, int width, float amount, Color* sums, Color* sharp);
  // Values with noise as bytes: blue, green, red. noises: kNoises of unit variance.
  void (*store)(const Color* values, int width, const Color* noises, float amount, uint64_t seed, uint8_t* bgr);

  static constexpr int kNoises = 1024;

  static const RowKernels& Portable();
  static const RowKernels& Get();
};

}  // namespace mapmend::simulate

#pragma once

#include <cstdint>

#include "procs/simulate/facets.h"

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

  static const RowKernels& Portable();
  static const RowKernels& Get();
};

}  // namespace mapmend::simulate
